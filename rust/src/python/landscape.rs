//! Bindings of the two landscapes, one at a time and side by side.

use std::cell::Cell;

use numpy::{PyArray2, PyReadwriteArray2};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use super::arrays::{Numbers, list, numbers, output, release, rows, vector};
use super::errors::{format_shape, wrong_type};
use super::pool;
use super::scalars::{name, real, shape as image_shape};
use super::scratch;
use crate::error::{Error, Result};
use crate::gaussian::Gaussian;
use crate::kernel::{Kernel, Trajectory, Widths, Workspace};
use crate::parallel;
use crate::shape::Shape;
use crate::support::Support;

type Landscape<'py> = Bound<'py, PyArray2<f32>>;

/// Buffers of one landscape.
#[derive(Default)]
struct Buffers {
    kernel: Workspace,
    support: Support,
}

thread_local! {
    static BUFFERS: Cell<Vec<Buffers>> = Cell::default();
}

/// Does some work with the buffers of `count` landscapes.
fn with_buffers<T>(count: usize, shape: Shape, work: impl FnOnce(&mut [Buffers]) -> T) -> T {
    scratch::with(&BUFFERS, count.saturating_mul(shape.pixels()), |buffers| {
        if buffers.len() < count {
            buffers.resize_with(count, Buffers::default);
        }
        work(&mut buffers[..count])
    })
}

/// A Gaussian inside its ellipse.
#[pyfunction]
#[pyo3(signature = (mean, chol, shape, cutoff, mixing, out, /))]
pub fn gaussian_landscape<'py>(
    py: Python<'py>,
    mean: &Bound<'py, PyAny>,
    chol: &Bound<'py, PyAny>,
    shape: &Bound<'py, PyAny>,
    cutoff: &Bound<'py, PyAny>,
    mixing: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Landscape<'py>> {
    let shape = image_shape(shape)?;
    let gaussian = Gaussian {
        mean: vector("mean", mean)?,
        chol: vector("chol", chol)?,
        cutoff: real("cutoff", cutoff)?,
        mixing: real("mixing", mixing)?,
    };
    let mut out = output("out", out, shape, &[mean, chol], py)?;
    let pixels = out.as_slice_mut()?;
    with_buffers(1, shape, |b| py.detach(|| gaussian.landscape(shape, &mut b[0].support, pixels)))?;
    Ok(release(out))
}

/// Gaussians side by side.
#[pyfunction]
#[pyo3(signature = (means, chols, shape, cutoff, mixing, out, /))]
pub fn gaussian_landscapes<'py>(
    py: Python<'py>,
    means: &Bound<'py, PyAny>,
    chols: &Bound<'py, PyAny>,
    shape: &Bound<'py, PyAny>,
    cutoff: &Bound<'py, PyAny>,
    mixing: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<Landscape<'py>>> {
    let shape = image_shape(shape)?;
    let (cutoff, mixing) = (real("cutoff", cutoff)?, real("mixing", mixing)?);
    let factors = rows::<3>("chols", chols)?;
    let centres = rows::<2>("means", means)?;
    if centres.len() != factors.len() {
        let expected = format!("one per row of means, ({}, 3)", centres.len());
        return Err(Error::shape("chols", expected, format!("({}, 3)", factors.len())).into());
    }
    let gaussians =
        centres.into_iter().zip(factors).map(|(mean, chol)| Gaussian { mean, chol, cutoff, mixing });
    let gaussians: Vec<Gaussian> = gaussians.collect();
    let mut outs = outputs(out, gaussians.len(), shape, &[means, chols], py)?;
    all(py, shape, &mut outs, |i, buffers, pixels| {
        let in_batch = |name: &str| match name {
            "mean" | "chol" => format!("{name}s[{i}]"),
            _ => name.into(),
        };
        gaussians[i].landscape(shape, &mut buffers.support, pixels).map_err(|e| e.renamed(in_batch))
    })?;
    Ok(outs.into_iter().map(release).collect())
}

/// The mean of the kernels on the points of a trajectory.
#[pyfunction]
#[pyo3(signature = (points, shape, width, kernel, weights, out, /))]
pub fn kernel_landscape<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    shape: &Bound<'py, PyAny>,
    width: &Bound<'py, PyAny>,
    kernel: &Bound<'py, PyAny>,
    weights: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Landscape<'py>> {
    let shape = image_shape(shape)?;
    let kernel = name("kernel", kernel, Kernel::named)?;
    let trajectory = Points::read(points, width, weights, ["points", "width", "weights"].map(str::to_owned))?;
    let inputs: Vec<&Bound<'py, PyAny>> = [points, width].into_iter().chain(weights).collect();
    let mut out = output("out", out, shape, &inputs, py)?;
    let pixels = out.as_slice_mut()?;
    with_buffers(1, shape, |b| py.detach(|| trajectory.landscape(kernel, shape, &mut b[0], pixels)))?;
    Ok(release(out))
}

/// Trajectories side by side.
#[pyfunction]
#[pyo3(signature = (points, shape, width, kernel, weights, out, /))]
pub fn kernel_landscapes<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    shape: &Bound<'py, PyAny>,
    width: &Bound<'py, PyAny>,
    kernel: &Bound<'py, PyAny>,
    weights: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<Landscape<'py>>> {
    let shape = image_shape(shape)?;
    let kernel = name("kernel", kernel, Kernel::named)?;
    let points = items("points", points, None)?;
    let count = Some(points.len());
    let each_width = match width.cast::<PyList>() {
        Ok(widths) => items("width", widths, count)?,
        Err(_) => vec![width.clone(); points.len()],
    };
    let each_weights = match weights {
        Some(weights) => items("weights", weights, count)?.into_iter().map(Some).collect(),
        None => vec![None; points.len()],
    };
    let per_item_width = width.is_instance_of::<PyList>();
    let mut trajectories = Vec::with_capacity(points.len());
    for i in 0..points.len() {
        let width_name = if per_item_width { format!("width[{i}]") } else { "width".into() };
        let names = [format!("points[{i}]"), width_name, format!("weights[{i}]")];
        let weights = each_weights[i].as_ref().filter(|w| !w.is_none());
        trajectories.push(Points::read(&points[i], &each_width[i], weights, names)?);
    }
    let inputs: Vec<&Bound<'py, PyAny>> =
        points.iter().chain(&each_width).chain(each_weights.iter().flatten()).collect();
    let mut outs = outputs(out, points.len(), shape, &inputs, py)?;
    all(py, shape, &mut outs, |i, buffers, pixels| {
        trajectories[i].landscape(kernel, shape, buffers, pixels)
    })?;
    Ok(outs.into_iter().map(release).collect())
}

/// A trajectory copied out of Python, with the names of its arguments for error messages.
struct Points {
    points: Vec<[f64; 2]>,
    width: Width,
    weights: Option<Vec<f64>>,
    names: [String; 3],
}

enum Width {
    Common([f64; 2]),
    PerPoint(Vec<[f64; 2]>),
}

impl Points {
    fn read(
        points: &Bound<'_, PyAny>,
        width: &Bound<'_, PyAny>,
        weights: Option<&Bound<'_, PyAny>>,
        names: [String; 3],
    ) -> PyResult<Self> {
        let points = rows::<2>(names[0].clone(), points)?;
        let weights = weights.map(|w| list(names[2].clone(), w)).transpose()?;
        let width = Width::read(&names[1], width, points.len())?;
        Ok(Self { points, width, weights, names })
    }

    fn landscape(&self, kernel: Kernel, shape: Shape, buffers: &mut Buffers, out: &mut [f32]) -> Result<()> {
        let widths = match &self.width {
            Width::Common(pair) => Widths::Common(*pair),
            Width::PerPoint(pairs) => Widths::PerPoint(pairs),
        };
        let weights = self.weights.as_deref();
        let trajectory = Trajectory { points: &self.points, widths, kernel, weights };
        let Buffers { kernel, support } = buffers;
        trajectory.landscape(shape, kernel, support, out).map_err(|e| {
            e.renamed(|name| match name {
                "points" => self.names[0].clone(),
                "width" => self.names[1].clone(),
                "weights" => self.names[2].clone(),
                _ => name.into(),
            })
        })
    }
}

impl Width {
    /// A number, a tuple (horizontal, vertical), or an array with one width or one pair per point.
    fn read(argument: &str, object: &Bound<'_, PyAny>, points: usize) -> PyResult<Self> {
        let pair = object.is_instance_of::<PyTuple>() || object.is_instance_of::<PyList>();
        let array = object.is_instance_of::<numpy::PyUntypedArray>();
        if !pair && !array {
            let h = real("width", object)?;
            return Ok(Self::Common([h, h]));
        }
        let Numbers { values, shape } = numbers(argument.to_owned(), object)?;
        match (shape.as_slice(), values.as_slice()) {
            ([2], &[h, v]) if pair => Ok(Self::Common([h, v])),
            ([], &[h]) => Ok(Self::Common([h, h])),
            // An array speaks of points, also when there are two: its meaning must not hang on N.
            (&[n], _) if array && n == points => Ok(Self::PerPoint(values.iter().map(|&h| [h, h]).collect())),
            (&[n, 2], _) if array && n == points => Ok(Self::PerPoint(values.as_chunks().0.to_vec())),
            _ => {
                let expected = format!(
                    "a number, a tuple (horizontal, vertical), or an array ({points},) or ({points}, 2)"
                );
                let kind = if array { "an array" } else { "a sequence" };
                let found = format!("{kind} of shape {}", format_shape(&shape));
                Err(Error::shape(argument.to_owned(), expected, found).into())
            }
        }
    }
}

/// The items of a list or tuple, of the given number if there is one.
fn items<'py>(
    argument: &'static str,
    object: &Bound<'py, PyAny>,
    count: Option<usize>,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let items: Vec<Bound<'py, PyAny>> = if let Ok(list) = object.cast::<PyList>() {
        list.iter().collect()
    } else if let Ok(tuple) = object.cast::<PyTuple>() {
        tuple.iter().collect()
    } else {
        return Err(wrong_type(argument, "a list with one entry per landscape", object));
    };
    match count {
        Some(count) if count != items.len() => {
            let expected = format!("a list of {count}, one per landscape");
            Err(Error::shape(argument, expected, items.len().to_string()).into())
        }
        _ => Ok(items),
    }
}

fn outputs<'py>(
    out: Option<&Bound<'py, PyAny>>,
    count: usize,
    shape: Shape,
    inputs: &[&Bound<'py, PyAny>],
    py: Python<'py>,
) -> PyResult<Vec<PyReadwriteArray2<'py, f32>>> {
    let Some(out) = out else {
        return (0..count).map(|_| pool::landscape(py, shape)).collect();
    };
    items("out", out, Some(count))?
        .iter()
        .enumerate()
        .map(|(i, out)| output(format!("out[{i}]"), Some(out), shape, inputs, py))
        .collect()
}

/// Runs the work on every output at once, detached from the interpreter; the first error in order wins.
fn all(
    py: Python<'_>,
    shape: Shape,
    outs: &mut [PyReadwriteArray2<'_, f32>],
    work: impl Fn(usize, &mut Buffers, &mut [f32]) -> Result<()> + Sync,
) -> PyResult<()> {
    let mut pixels = Vec::with_capacity(outs.len());
    for out in outs {
        pixels.push(out.as_slice_mut()?);
    }
    with_buffers(pixels.len(), shape, |buffers| {
        let tasks = pixels.into_iter().zip(buffers).map(|(pixels, buffers)| (pixels, buffers, Ok(())));
        let mut tasks: Vec<_> = tasks.collect();
        py.detach(|| {
            parallel::for_each(&mut tasks, |i, (pixels, buffers, result)| *result = work(i, buffers, pixels));
            tasks.into_iter().try_for_each(|(.., result)| result)
        })
    })?;
    Ok(())
}
