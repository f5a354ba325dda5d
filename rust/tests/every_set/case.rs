//! How cases are drawn, run and reported.

use std::fmt::Debug;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

use motorprime::Shape;
use motorprime::rng::{Xoshiro256PlusPlus, uniform};
use rand_core::RngCore;

/// One input of a kernel.
pub trait Case: Debug {
    /// Buffers that go from case to case, as a control loop's do.
    type Space: Default;
    /// Name in the report.
    const NAME: &str;
    /// Makes a case.
    fn draw(draw: &mut Draw) -> Self;
    /// Runs it on every instruction set; returns the error relative to what is allowed.
    fn check(&self, space: &mut Self::Space) -> Result<f64, String>;
}

/// Runs as many cases as asked, or else a number that a debug build bears.
pub fn stress<C: Case>(few: u64) {
    let variable = |name| std::env::var(name).ok().map(|x: String| x.parse::<u64>().expect("a number"));
    let cases = variable("MOTORPRIME_CASES").unwrap_or(few);
    let first = variable("MOTORPRIME_SEED").unwrap_or(1);
    let start = Instant::now();
    let mut space = C::Space::default();
    let (mut worst, mut at) = (0.0, first);
    for seed in (0..cases).map(|i| first.wrapping_add(i)) {
        let case = C::draw(&mut Draw(Xoshiro256PlusPlus::new(seed)));
        match catch_unwind(AssertUnwindSafe(|| case.check(&mut space))) {
            Ok(Ok(error)) if error <= worst => {}
            Ok(Ok(error)) => (worst, at) = (error, seed),
            Ok(Err(what)) => panic!("{}, MOTORPRIME_SEED={seed}: {what}\n{case:?}", C::NAME),
            Err(_) => panic!("{}, MOTORPRIME_SEED={seed} panicked\n{case:?}", C::NAME),
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    println!("{}: {cases} cases in {seconds:.1} s, worst error {worst:.3e} (seed {at})", C::NAME);
}

/// An error of the twin's finding, unless the condition holds.
pub fn ensure(holds: bool, what: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(what()) }
}

/// Whether two images have the same bits.
pub fn same_bits(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// A source of adversarial numbers.
pub struct Draw(pub Xoshiro256PlusPlus);

impl Draw {
    pub fn unit(&mut self) -> f64 {
        uniform(&mut self.0)
    }

    pub fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.0.next_u64() % n as u64) as usize
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub fn pick<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.below(items.len())]
    }

    /// A power of two times a number in `[1, 2)`.
    pub fn octaves(&mut self, low: i32, high: i32) -> f64 {
        let exponent = low + self.below((high - low) as usize) as i32;
        (1.0 + self.unit()) * 2.0_f64.powi(exponent / 2) * 2.0_f64.powi(exponent - exponent / 2)
    }

    pub fn sign(&mut self) -> f64 {
        self.pick(&[-1.0, 1.0])
    }

    /// A number near 1 by a rounding or by a little more, or exactly 1.
    pub fn nearly_one(&mut self) -> f64 {
        1.0 + self.sign() * self.pick(&[0.0, f64::EPSILON, 1e-15, 1e-9, 1e-7, 1e-3])
    }

    /// Mostly tiny images, some long and thin ones, now and then a large one.
    pub fn shape(&mut self) -> Shape {
        let [height, width] = match self.below(2000) {
            0 => [200, 300],
            1..100 => [1, 1 + self.below(400)],
            100..200 => [1 + self.below(400), 1],
            200..600 => [1 + self.below(40), 1 + self.below(40)],
            _ => [1 + self.below(12), 1 + self.below(20)],
        };
        Shape::new(height, width).expect("small")
    }
}
