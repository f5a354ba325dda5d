//! Which instruction set the kernels run on, chosen when the program runs and not when it is built.
//!
//! Every kernel is written once, in plain loops that the compiler vectorises, and is compiled for each of the
//! sets below. No loop relies on fused multiply-add or on the number of lanes, so all sets give the same bits.
//! Whatever such a loop calls must be `#[inline(always)]`: a function that is not inlined is compiled for the
//! baseline only.

use std::sync::OnceLock;

use pulp::Arch;

/// An instruction set of this machine.
#[derive(Clone, Copy, Debug)]
pub struct Simd(Arch);

/// Work that is compiled for every instruction set. Mark the implementation of `run` `#[inline(always)]`.
pub(crate) trait Kernel {
    /// What the work returns.
    type Output;
    /// Does the work.
    fn run(self) -> Self::Output;
}

impl Simd {
    /// The environment variable that sets an upper limit: `baseline`, `avx2` or `avx512`.
    pub const VARIABLE: &str = "MOTORPRIME_SIMD";

    /// The best set of this machine, or the one that [`Simd::VARIABLE`] names if the machine has it.
    pub fn best() -> Self {
        static BEST: OnceLock<Simd> = OnceLock::new();
        *BEST.get_or_init(|| {
            let all = Self::all();
            let wanted = std::env::var(Self::VARIABLE).unwrap_or_default();
            let named = all.iter().find(|simd| simd.name() == wanted);
            named.or(all.last()).copied().unwrap_or(Self(Arch::Scalar))
        })
    }

    /// Every set of this machine, from the one that every wheel runs on to the best.
    pub fn all() -> Vec<Self> {
        let mut all = vec![Self(Arch::Scalar)];
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(pulp::x86::V3::try_new().map(|v3| Self(Arch::V3(v3))));
            all.extend(pulp::x86::V4::try_new().map(|v4| Self(Arch::V4(v4))));
        }
        all
    }

    /// Its name: `baseline`, `avx2` or `avx512`.
    pub fn name(self) -> &'static str {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Arch::V3(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Arch::V4(_) => "avx512",
            _ => "baseline",
        }
    }

    /// The set itself, for the few things that a plain loop cannot say.
    pub(crate) fn arch(self) -> Arch {
        self.0
    }

    /// Runs the work on this set.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        struct Op<K>(K);
        impl<K: Kernel> pulp::WithSimd for Op<K> {
            type Output = K::Output;
            #[inline(always)]
            fn with_simd<S: pulp::Simd>(self, _: S) -> K::Output {
                self.0.run()
            }
        }
        self.0.dispatch(Op(kernel))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_baseline_comes_first_and_the_best_is_among_all() {
        let names: Vec<_> = Simd::all().into_iter().map(Simd::name).collect();
        assert_eq!(names[0], "baseline");
        assert!(names.contains(&Simd::best().name()));
    }

    #[test]
    fn every_set_runs_the_same_work() {
        struct Sum<'a>(&'a [u32]);
        impl Kernel for Sum<'_> {
            type Output = u32;
            #[inline(always)]
            fn run(self) -> u32 {
                self.0.iter().sum()
            }
        }
        for simd in Simd::all() {
            assert_eq!(simd.run(Sum(&[1, 2, 3])), 6, "{}", simd.name());
        }
    }
}
