//! The search of a pose by the edges of photo and cloud, and what it is made of.

mod density;
mod descent;
mod projection;
mod search;
