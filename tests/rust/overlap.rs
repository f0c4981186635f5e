//! The overlap error against closed forms, laws, and sampling.
