//! Binding of the coupled dynamical systems.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::arrays::{Numbers, empty, numbers, release, rows, vector};
use super::errors::{format_shape, wrong_type};
use super::scalars::{real, whole};
use crate::dynamics::{self as kernel, Coupling, Gaussians, Rates, State, System, Tolerance, Watch};
use crate::error::Error;

/// Eye, arm and hand as coupled dynamical systems.
#[pyclass(frozen, module = "motorprime._core")]
pub struct CoupledSystem(kernel::CoupledSystem);

type Ends<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<bool>>);

#[pymethods]
impl CoupledSystem {
    #[new]
    #[pyo3(signature = (eye, arm, hand, eye_arm, arm_hand, alpha, beta, close))]
    #[expect(clippy::too_many_arguments, reason = "five blocks and their rates")]
    fn new(
        eye: &Bound<'_, PyAny>,
        arm: &Bound<'_, PyAny>,
        hand: &Bound<'_, PyAny>,
        eye_arm: &Bound<'_, PyAny>,
        arm_hand: &Bound<'_, PyAny>,
        alpha: &Bound<'_, PyAny>,
        beta: &Bound<'_, PyAny>,
        close: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let systems = [system("eye", eye)?, system("arm", arm)?, system("hand", hand)?];
        let couplings = [coupling("eye_arm", eye_arm)?, coupling("arm_hand", arm_hand)?];
        let rates = Rates {
            alpha: vector("alpha", alpha)?,
            beta: vector("beta", beta)?,
            close: real("close", close)?,
        };
        Ok(Self(kernel::CoupledSystem::new(systems.each_ref(), couplings.each_ref(), rates)?))
    }

    /// One movement: its states and whether it arrived.
    #[pyo3(signature = (state, amplitude, dt, steps, tolerance, /))]
    fn roll_out<'py>(
        &self,
        state: &Bound<'py, PyAny>,
        amplitude: &Bound<'py, PyAny>,
        dt: &Bound<'py, PyAny>,
        steps: &Bound<'py, PyAny>,
        tolerance: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, bool)> {
        let py = state.py();
        let start: State = vector("state", state)?;
        let (amplitude, dt) = (real("amplitude", amplitude)?, real("dt", dt)?);
        let (steps, tolerance) = (count(steps)?, tolerance_of(tolerance)?);
        let mut path = Vec::new();
        let arrived = py
            .detach(|| self.0.roll_out(&start, amplitude, dt, steps, &tolerance, &mut path))
            .map_err(PyErr::from)?;
        Ok((states(py, path.iter(), path.len())?, arrived))
    }

    /// The ends of many movements: states, steps until they arrived or -1, whether the hand closed early.
    #[pyo3(signature = (states, amplitude, dt, steps, tolerance, watch, /))]
    fn ends<'py>(
        &self,
        states: &Bound<'py, PyAny>,
        amplitude: &Bound<'py, PyAny>,
        dt: &Bound<'py, PyAny>,
        steps: &Bound<'py, PyAny>,
        tolerance: &Bound<'py, PyAny>,
        watch: &Bound<'py, PyAny>,
    ) -> PyResult<Ends<'py>> {
        let py = states.py();
        let starts: Vec<State> = rows("states", states)?;
        let (amplitude, dt) = (real("amplitude", amplitude)?, real("dt", dt)?);
        let each = steps.try_iter().map_err(|_| wrong_type("steps", "whole numbers", steps))?;
        let steps = each.map(|item| count(&item?)).collect::<PyResult<Vec<usize>>>()?;
        let tolerance = tolerance_of(tolerance)?;
        let [opening, distance] = vector("watch", watch)?;
        let watch = Watch { opening, distance };
        let ends = py.detach(|| self.0.ends(&starts, amplitude, dt, &steps, &tolerance, &watch))?;
        let arrived = ends.iter().map(|end| end.arrived.map_or(-1, |steps| steps as i64));
        let (arrived, early) = (arrived.collect(), ends.iter().map(|end| end.closed_early).collect());
        let last = self::states(py, ends.iter().map(|end| &end.state), ends.len())?;
        Ok((last, PyArray1::from_vec(py, arrived), PyArray1::from_vec(py, early)))
    }

    fn __repr__(&self) -> String {
        let [eye, arm, hand] = self.0.components();
        format!("CoupledSystem({eye}, {arm} and {hand} components of eye, arm and hand)")
    }
}

/// A new array (N, 10).
fn states<'py, 'a>(
    py: Python<'py>,
    rows: impl Iterator<Item = &'a State>,
    count: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let mut out = empty::<f64>(py, [count, 10])?;
    for (to, from) in out.as_slice_mut()?.as_chunks_mut::<10>().0.iter_mut().zip(rows) {
        *to = *from;
    }
    Ok(release(out))
}

/// More than an address can hold is as wrong as the largest that it can.
fn count(object: &Bound<'_, PyAny>) -> PyResult<usize> {
    Ok(usize::try_from(whole("steps", object, 0)?).unwrap_or(usize::MAX))
}

fn tolerance_of(object: &Bound<'_, PyAny>) -> PyResult<Tolerance> {
    let [fixation, place, turn, opening] = vector("tolerance", object)?;
    Ok(Tolerance { fixation, place, turn, opening })
}

/// (weights, means, covariances, matrices).
fn system(name: &'static str, object: &Bound<'_, PyAny>) -> PyResult<System> {
    let items = four(name, "(weights, means, covariances, matrices)", object)?;
    let (mixture, [components, _]) = gaussians(name, &items)?;
    let argument = format!("{name}.matrices");
    let Numbers { values, shape } = numbers(argument.clone(), &items[3])?;
    match shape[..] {
        [k, rows, columns] if k == components && rows == columns => Ok(System { mixture, matrices: values }),
        _ => Err(Error::shape(argument, format!("({components}, d, d)"), format_shape(&shape)).into()),
    }
}

/// (weights, means, covariances, near).
fn coupling(name: &'static str, object: &Bound<'_, PyAny>) -> PyResult<Coupling> {
    let items = four(name, "(weights, means, covariances, near)", object)?;
    let (mixture, _) = gaussians(name, &items)?;
    Ok(Coupling { mixture, near: real(name, &items[3])? })
}

fn four<'py>(
    name: &'static str,
    expected: &'static str,
    object: &Bound<'py, PyAny>,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    match object.cast::<PyTuple>() {
        Ok(tuple) if tuple.len() == 4 => Ok(tuple.iter().collect()),
        _ => Err(wrong_type(name, expected, object)),
    }
}

/// A mixture, its components and coordinates.
fn gaussians(name: &'static str, items: &[Bound<'_, PyAny>]) -> PyResult<(Gaussians, [usize; 2])> {
    let read = |at: usize, part: &str| numbers(format!("{name}.{part}"), &items[at]);
    let wrong = |part: &str, expected: String, found: &[usize]| -> PyErr {
        Error::shape(format!("{name}.{part}"), expected, format_shape(found)).into()
    };
    let (weights, means) = (read(0, "weights")?, read(1, "means")?);
    let covariances = read(2, "covariances")?;
    let [components] = weights.shape[..] else {
        return Err(wrong("weights", "(K,)".into(), &weights.shape));
    };
    let coordinates = match means.shape[..] {
        [k, m] if k == components => m,
        _ => return Err(wrong("means", format!("({components}, m)"), &means.shape)),
    };
    if covariances.shape != [components, coordinates, coordinates] {
        let expected = format!("({components}, {coordinates}, {coordinates})");
        return Err(wrong("covariances", expected, &covariances.shape));
    }
    let mixture = Gaussians { weights: weights.values, means: means.values, covariances: covariances.values };
    Ok((mixture, [components, coordinates]))
}
