//! Random inputs through the kernels of the crate and whole estimates, debug assertions and overflow checks on.
//!
//!     cargo run --profile test --example fuzz -- --seconds 60
//!     cargo run --profile test --example fuzz -- --target estimate --runs 100000 --seed 3
//!
//! A find is a panic, a result that breaks a law of the kernel, or a run that doesn't end within a minute of processor time. Each kind is shown as soon as it is met, with its seed, by which it comes again: `--target T --seed S --runs 1`.
//! Each minute the error stream says how far it is, so that a run that is ended early has told what it had tried.
//! The exit code is 1 if there were any. Runs are timed by the main thread's own processor time, on Linux.

mod kernels;
mod problems;
#[path = "../../tests/rust/support/random.rs"]
#[allow(dead_code, reason = "the tests use more of it")]
mod random;
mod shapes;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use random::Random;
use regionpose::internals::budget::Budget;

/// What is wrong with a result, if anything; `Ok(true)` where the input was taken, `Ok(false)` where it was refused.
pub type Outcome = Result<bool, String>;

/// A kernel with its name.
type Target = (&'static str, fn(&mut Random, &Budget) -> Outcome);

const TARGETS: [Target; 11] = [
    ("rings", kernels::whole_rings),
    ("moments", kernels::moments),
    ("mesh", kernels::mesh),
    ("outline", kernels::outline),
    ("clipping", kernels::clipping),
    ("overlap", kernels::overlap),
    ("chart", kernels::chart),
    ("border", problems::border),
    ("contours", problems::contours),
    ("estimate", problems::estimate),
    ("samples", problems::samples),
];

/// A run may take so many seconds of processor time.
const LONGEST: f64 = 60.0;

/// How often the watch looks, and how often it says how far the runs are.
const LOOK: Duration = Duration::from_millis(500);
const REPORT: Duration = Duration::from_secs(60);

/// Shares of a run's seconds between the targets: estimates, which hold all kernels, have half of them.
fn share(name: &str) -> f64 {
    if name == "estimate" { 0.5 } else { 0.5 / (TARGETS.len() - 1) as f64 }
}

struct Given {
    seconds: f64,
    runs: usize,
    seed: u64,
    target: String,
}

/// What runs of a target came to.
#[derive(Default)]
struct Tally {
    runs: usize,
    taken: usize,
    /// Seconds of those that were taken, and the work that they counted: what is refused is told at a glance.
    times: Vec<f64>,
    works: Vec<f64>,
    /// The work over that of one look at all of the problem, of whole problems.
    looks: Vec<f64>,
    slowest: (f64, u64),
    most: (f64, u64),
    most_looks: (f64, u64),
    /// By kind: how often, and the first with its seed.
    finds: BTreeMap<String, (usize, u64, String)>,
}

/// What one look at all of the problem of the run counts as; zero where a run is no whole problem.
pub static LOOK_WORK: AtomicU64 = AtomicU64::new(0);

/// The seed of the run that goes on, and when it began, for the watch.
static RUNNING: AtomicU64 = AtomicU64::new(0);
static BEGAN: Mutex<Option<f64>> = Mutex::new(None);

/// The message of the last panic, with its place.
static PANIC: Mutex<String> = Mutex::new(String::new());

fn main() -> ExitCode {
    let given = match given(std::env::args().skip(1)) {
        Ok(given) => given,
        Err(message) => {
            eprintln!("{message}");
            return ExitCode::from(2);
        }
    };
    std::panic::set_hook(Box::new(|info| *PANIC.lock().unwrap_or_else(|held| held.into_inner()) = info.to_string()));
    std::thread::spawn(watch);
    let chosen: Vec<&Target> = TARGETS.iter().filter(|(name, _)| name.contains(&given.target)).collect();
    let whole: f64 = chosen.iter().map(|(name, _)| share(name)).sum();
    let mut found = chosen.is_empty();
    for target in chosen {
        let tally = tally(target, &given, given.seconds * share(target.0) / whole);
        found |= !tally.finds.is_empty();
        print(target.0, tally);
    }
    if found { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

fn given(mut arguments: impl Iterator<Item = String>) -> Result<Given, String> {
    let mut given = Given { seconds: f64::INFINITY, runs: usize::MAX, seed: 0, target: String::new() };
    while let Some(name) = arguments.next() {
        let value = arguments.next().ok_or(format!("{name}: needed a value"))?;
        let refused = || format!("{name}: found {value:?}; needed a number");
        match name.as_str() {
            "--seconds" => given.seconds = value.parse().map_err(|_| refused())?,
            "--runs" => given.runs = value.parse().map_err(|_| refused())?,
            "--seed" => given.seed = value.parse().map_err(|_| refused())?,
            "--target" => given.target = value,
            _ => return Err(format!("found {name}; needed --seconds, --runs, --seed or --target")),
        }
    }
    let bounded = given.seconds.is_finite() || given.runs < usize::MAX;
    bounded.then_some(given).ok_or("needed --seconds or --runs".into())
}

/// Runs a target with the seeds from the given one on.
fn tally(&(_, run): &Target, given: &Given, seconds: f64) -> Tally {
    let (start, mut tally) = (Instant::now(), Tally::default());
    for seed in (given.seed..).take(given.runs) {
        if start.elapsed().as_secs_f64() > seconds {
            break;
        }
        RUNNING.store(seed, Ordering::Relaxed);
        LOOK_WORK.store(0, Ordering::Relaxed);
        let before = processor_time();
        set_began(Some(before));
        let budget = Budget::unlimited();
        let outcome = catch_unwind(AssertUnwindSafe(|| run(&mut Random::new(seed), &budget)));
        let work = budget.charged();
        let look = LOOK_WORK.load(Ordering::Relaxed);
        let looks = (look > 0).then(|| work as f64 / look as f64);
        let cost = Cost { seconds: processor_time() - before, work: work as f64, looks };
        set_began(None);
        tally.add(seed, cost, outcome.unwrap_or_else(|_| Err(last_panic())));
    }
    tally
}

/// What a run took: processor time, and what it counted itself.
struct Cost {
    seconds: f64,
    work: f64,
    looks: Option<f64>,
}

impl Tally {
    fn add(&mut self, seed: u64, Cost { seconds, work, looks }: Cost, outcome: Outcome) {
        match outcome {
            Ok(true) => {
                self.taken += 1;
                self.times.push(seconds);
                self.works.push(work);
                self.looks.extend(looks);
            }
            Ok(false) => {}
            Err(what) => {
                let kind = kind_of(&what);
                if !self.finds.contains_key(&kind) {
                    eprintln!("seed {seed}: {what}");
                }
                self.finds.entry(kind).or_insert((0, seed, what)).0 += 1;
            }
        }
        self.runs += 1;
        self.slowest = later(self.slowest, (seconds, seed));
        self.most = later(self.most, (work, seed));
        self.most_looks = later(self.most_looks, (looks.unwrap_or(0.0), seed));
    }
}

/// The greater of two, the first if they are equal.
fn later(first: (f64, u64), second: (f64, u64)) -> (f64, u64) {
    if second.0 > first.0 { second } else { first }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// A message without its numbers, so that equal finds are counted together.
fn kind_of(message: &str) -> String {
    message.split_whitespace().filter(|word| !word.contains(|c: char| c.is_ascii_digit())).collect::<Vec<_>>().join(" ")
}

fn print(name: &str, mut tally: Tally) {
    let (count, taken) = (tally.runs, tally.taken);
    let (slowest, seed) = tally.slowest;
    println!(
        "{name:9} {count:9} runs, {:3.0} % taken; median {:.3} ms, longest {:.1} ms (seed {seed})",
        100.0 * taken as f64 / count.max(1) as f64,
        1e3 * median(&mut tally.times),
        1e3 * slowest
    );
    let (most, seed) = tally.most;
    if most > 0.0 {
        println!("{:10} edges looked at: median {:.1e}, most {most:.1e} (seed {seed})", "", median(&mut tally.works));
    }
    let (most, seed) = tally.most_looks;
    if most > 0.0 {
        println!(
            "{:10} looks at all of a problem: median {:.0}, most {most:.0} (seed {seed})",
            "",
            median(&mut tally.looks)
        );
    }
    for (times, seed, what) in tally.finds.values() {
        println!("{times:10}  seed {seed}: {what}");
    }
}

fn last_panic() -> String {
    format!("panic: {}", PANIC.lock().unwrap_or_else(|held| held.into_inner()))
}

fn set_began(at: Option<f64>) {
    *BEGAN.lock().unwrap_or_else(|held| held.into_inner()) = at;
}

/// Says how far the runs are, and ends everything where one takes far too long.
fn watch() {
    let mut said = Instant::now();
    loop {
        std::thread::sleep(LOOK);
        if said.elapsed() >= REPORT {
            said = Instant::now();
            eprintln!("at the seed {}", RUNNING.load(Ordering::Relaxed));
        }
        let began = *BEGAN.lock().unwrap_or_else(|held| held.into_inner());
        if began.is_some_and(|at| processor_time() - at > LONGEST) {
            println!("the run with the seed {} does not end", RUNNING.load(Ordering::Relaxed));
            std::process::exit(1);
        }
    }
}

/// Seconds that the main thread, on which all runs are, has been on a processor, whatever else the machine does.
fn processor_time() -> f64 {
    let read = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    read.split_whitespace().next().and_then(|first| first.parse::<f64>().ok()).unwrap_or(0.0) * 1e-9
}
