//! Binding of the fused cycle.

use std::cell::Cell;

use numpy::ndarray::Ix2;
use numpy::{PyReadwriteArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use super::arrays::{list, rows, writable};
use super::mlp::Mlp;
use super::scalars::{name, real, shape as image_shape, whole};
use super::scratch;
use crate::error::Error;
use crate::kernel::Kernel;
use crate::shape::Shape;
use crate::step::{self as kernel, Look, Map, Plan, Sight, Task, View, Workspace};
use crate::threshold::Wanted;

thread_local! {
    static WORKSPACES: Cell<Vec<Workspace>> = Cell::default();
}

/// How the plan appears in a camera, as it came from Python.
enum Source<'py> {
    Network(PyRef<'py, Mlp>, Option<PyRef<'py, Mlp>>),
    Matrix([f64; 12]),
    Pixels(Vec<[f64; 2]>),
}

/// Where to look, as it came from Python.
enum Target<'py> {
    Windows(PyReadwriteArray2<'py, i32>),
    Mask(Wanted, PyReadwriteArray2<'py, bool>),
}

/// A camera as it came from Python.
struct Camera<'py> {
    name: String,
    source: Source<'py>,
    shape: Shape,
    stride: usize,
    width: [f64; 2],
    landscape: PyReadwriteArray2<'py, f32>,
    target: Target<'py>,
}

/// Landscapes and looks of all cameras. For each: None if the plan is behind it, False if beside its image,
/// True for windows and the threshold for a mask.
#[expect(clippy::too_many_arguments, reason = "they are the arguments of the Python function")]
#[pyfunction]
#[pyo3(signature = (cameras, points, joints, kernel, cutoff, mixing, fraction, count, stride, seed, threads, /))]
pub fn attention_step<'py>(
    py: Python<'py>,
    cameras: &Bound<'py, PyList>,
    points: Option<&Bound<'py, PyAny>>,
    joints: Option<&Bound<'py, PyAny>>,
    kernel: &Bound<'py, PyAny>,
    cutoff: &Bound<'py, PyAny>,
    mixing: &Bound<'py, PyAny>,
    fraction: Option<&Bound<'py, PyAny>>,
    count: Option<&Bound<'py, PyAny>>,
    stride: usize,
    seed: u64,
    threads: bool,
) -> PyResult<Vec<Py<PyAny>>> {
    let wanted = match (fraction, count) {
        (Some(fraction), _) => Some(Wanted::Fraction(real("fraction", fraction)?)),
        (None, Some(count)) => Some(Wanted::Count(whole("count", count, 1)?)),
        (None, None) => None,
    };
    // Named whether or not a camera sees anything.
    wanted.map(|wanted| wanted.of(1, 1)).transpose()?;
    let given = points.map(|p| rows::<3>("points", p)).transpose()?;
    let joints = joints.map_or(Ok(Vec::new()), |j| list("joints", j))?;
    if let Some(at) = joints.iter().position(|x| !x.is_finite()) {
        return Err(Error::element("joints", &[at], "finite", joints[at]).into());
    }
    let points = given.as_deref().unwrap_or_default();
    if given.is_some() && points.is_empty() {
        return Err(Error::shape("points", "(N, 3) with N >= 1", "(0, 3)").into());
    }
    if let Some(at) = points.as_flattened().iter().position(|x| !x.is_finite()) {
        let value = points.as_flattened()[at];
        return Err(Error::element("points", &[at / 3, at % 3], "finite", value).into());
    }
    let plan = Plan {
        points,
        joints: &joints,
        kernel: name("kernel", kernel, Kernel::named)?,
        cutoff: real("cutoff", cutoff)?,
        mixing: real("mixing", mixing)?,
    };

    let mut read = Vec::with_capacity(cameras.len());
    for camera in cameras {
        read.push(Camera::read(camera.cast::<PyTuple>()?, wanted, stride)?);
    }
    let pixels = read.iter().map(|camera| camera.shape.pixels()).sum();
    let path = given.is_some();
    let sights = scratch::with(&WORKSPACES, pixels, |workspaces| {
        if workspaces.len() < read.len() {
            workspaces.resize_with(read.len(), Workspace::default);
        }
        let mut names = Vec::with_capacity(read.len());
        let mut tasks = Vec::with_capacity(read.len());
        for ((k, camera), workspace) in (0_u64..).zip(&mut read).zip(workspaces) {
            names.push(&camera.name);
            let map = match &camera.source {
                Source::Network(place, sight) if path => {
                    Map::Network(&place.0, sight.as_ref().map(|sight| &sight.0))
                }
                Source::Network(network, _) => Map::Ellipse(&network.0),
                Source::Matrix(matrix) => Map::Matrix(matrix),
                Source::Pixels(pixels) => Map::Pixels(pixels),
            };
            let look = match &mut camera.target {
                Target::Windows(centres) => Look::Windows(centres.as_slice_mut()?),
                Target::Mask(wanted, mask) => Look::Mask(*wanted, mask.as_slice_mut()?),
            };
            let view = View {
                shape: camera.shape,
                stride: camera.stride,
                map,
                width: camera.width,
                seed: seed.wrapping_add(k),
                landscape: camera.landscape.as_slice_mut()?,
                look,
            };
            tasks.push(Task { view, workspace, result: Ok(Sight::Behind) });
        }
        py.detach(|| kernel::run(&plan, &mut tasks, threads));
        let of_camera = |name: &str, camera: &str| match name {
            "points" if !path => format!("pixels['{camera}']"),
            "maps" => format!("maps['{camera}']"),
            "x" => format!("points or joints, for maps['{camera}'],"),
            _ => name.into(),
        };
        let results = tasks.into_iter().zip(names);
        results
            .map(|(task, camera)| task.result.map_err(|e| e.renamed(|name| of_camera(name, camera)).into()))
            .collect::<PyResult<Vec<Sight>>>()
    })?;
    sights
        .into_iter()
        .map(|sight| match sight {
            Sight::Behind => Ok(py.None()),
            Sight::Beside => Ok(false.into_pyobject(py)?.to_owned().into_any().unbind()),
            Sight::Seen(None) => Ok(true.into_pyobject(py)?.to_owned().into_any().unbind()),
            Sight::Seen(Some(level)) => Ok(level.into_pyobject(py)?.into_any().unbind()),
        })
        .collect()
}

impl<'py> Camera<'py> {
    /// Reads (name, map, shape, width, landscape, centres or mask).
    fn read(camera: &Bound<'py, PyTuple>, wanted: Option<Wanted>, stride: usize) -> PyResult<Self> {
        let name: String = camera.get_item(0)?.extract()?;
        let [map, shape, width, landscape, look] = [1, 2, 3, 4, 5].map(|k| camera.get_item(k));
        let (map, shape, width, landscape, look) = (map?, shape?, width?, landscape?, look?);
        let source = Source::read(&name, &map)?;
        let shape = image_shape(&shape)?;
        let size = [shape.height(), shape.width()];
        let of_out = |part: &str| format!("out['{name}'].{part}");
        let target = match wanted {
            None => {
                // The number of windows is the number of rows that there is room for.
                let rows = look.cast::<PyUntypedArray>().map_or(0, |array| array.shape()[0]);
                Target::Windows(writable::<i32, Ix2>(of_out("centres"), &look, &[rows, 2], &[])?)
            }
            Some(wanted) => Target::Mask(wanted, writable::<bool, Ix2>(of_out("mask"), &look, &size, &[])?),
        };
        let cells = size.map(|side| side.div_ceil(stride));
        let landscape = writable::<f32, Ix2>(of_out("landscape"), &landscape, &cells, &[&map])?;
        Ok(Self { source, shape, stride, width: sides(&width)?, landscape, target, name })
    }
}

/// A kernel width: a number or (horizontal, vertical).
fn sides(width: &Bound<'_, PyAny>) -> PyResult<[f64; 2]> {
    let Ok(pair) = width.cast::<PyTuple>() else {
        return real("width", width).map(|h| [h, h]);
    };
    if pair.len() != 2 {
        let found = format!("a tuple of {}", pair.len());
        return Err(Error::shape("width", "a number or (horizontal, vertical)", found).into());
    }
    Ok([real("width", &pair.get_item(0)?)?, real("width", &pair.get_item(1)?)?])
}

impl<'py> Source<'py> {
    fn read(camera: &str, map: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(network) = map.cast::<Mlp>() {
            return Ok(Self::Network(network.borrow(), None));
        }
        if let Ok(pair) = map.cast::<PyTuple>() {
            let network = |k| Ok::<_, PyErr>(pair.get_item(k)?.cast_into::<Mlp>()?.borrow());
            return Ok(Self::Network(network(0)?, Some(network(1)?)));
        }
        if map.cast::<PyUntypedArray>().is_ok_and(|array| array.shape() == [3, 4]) {
            let name = format!("maps['{camera}']");
            let matrix = rows::<4>(name.clone(), map)?;
            let mut flat = [0.0; 12];
            flat.copy_from_slice(matrix.as_flattened());
            if let Some(at) = flat.iter().position(|x| !x.is_finite()) {
                return Err(Error::element(name, &[at / 4, at % 4], "finite", flat[at]).into());
            }
            return Ok(Self::Matrix(flat));
        }
        let name = format!("pixels['{camera}']");
        let pixels = rows::<2>(name.clone(), map)?;
        if let Some(at) = pixels.as_flattened().iter().position(|x| x.is_infinite()) {
            let value = pixels.as_flattened()[at];
            return Err(Error::element(name, &[at / 2, at % 2], "finite or NaN", value).into());
        }
        Ok(Self::Pixels(pixels))
    }
}
