//! Kernel errors as the exceptions of `motorprime.errors`.

use pyo3::prelude::*;
use pyo3::types::PyType;

use crate::error::Error;

mod exceptions {
    pyo3::import_exception!(motorprime.errors, ArgumentError);
    pyo3::import_exception!(motorprime.errors, ArgumentTypeError);
    pyo3::import_exception!(motorprime.errors, StateError);
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        let message = error.to_string();
        match error {
            Error::Type { .. } => exceptions::ArgumentTypeError::new_err(message),
            Error::Busy { .. } => exceptions::StateError::new_err(message),
            _ => exceptions::ArgumentError::new_err(message),
        }
    }
}

/// An argument of a wrong type.
pub fn wrong_type(
    argument: impl Into<crate::error::Argument>,
    expected: impl Into<std::borrow::Cow<'static, str>>,
    given: &Bound<'_, PyAny>,
) -> PyErr {
    Error::Type { argument: argument.into(), expected: expected.into(), found: describe(given) }.into()
}

/// What an object is, in the words of an error message.
pub fn describe(object: &Bound<'_, PyAny>) -> String {
    use numpy::{PyUntypedArray, PyUntypedArrayMethods};
    if let Ok(array) = object.cast::<PyUntypedArray>() {
        let shape = format_shape(array.shape());
        return format!("an array of {} with shape {shape}", array.dtype());
    }
    if let Ok(class) = object.cast::<PyType>() {
        return format!("the class {class}");
    }
    let class = object.get_type();
    class
        .name()
        .map_or_else(|_| "an object".into(), |name| format!("{name} {object:?}"))
        .chars()
        .take(200)
        .collect()
}

/// A shape in Python's notation.
pub fn format_shape(shape: &[usize]) -> String {
    match shape {
        [n] => format!("({n},)"),
        _ => {
            let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
            format!("({})", sizes.join(", "))
        }
    }
}
