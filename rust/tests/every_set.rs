//! Every kernel on every instruction set, on small cases made to break it, against plain twins in float64.
//!
//! `MOTORPRIME_CASES` is the number of cases of each kernel, `MOTORPRIME_SEED` the seed of the first; case `i`
//! has the seed of the first plus `i`, so that one case can be run again alone. For a long run:
//! `MOTORPRIME_CASES=1000000 cargo test --release --test every_set -- --nocapture --test-threads 1`.

#[path = "every_set/case.rs"]
mod case;
#[path = "every_set/ellipse.rs"]
mod ellipse;
#[path = "every_set/keypoints.rs"]
mod keypoints;
#[path = "every_set/network.rs"]
mod network;
#[path = "every_set/pinned.rs"]
mod pinned;
#[path = "every_set/samplers.rs"]
mod samplers;
#[path = "every_set/scan.rs"]
mod scan;
#[path = "every_set/threshold.rs"]
mod threshold;
#[path = "every_set/trajectory.rs"]
mod trajectory;
