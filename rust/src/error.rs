//! The one error of the kernels: which argument, what was expected, what was found and where.

use std::borrow::Cow;
use std::fmt;

/// Result of every kernel.
pub type Result<T> = std::result::Result<T, Error>;

/// Name of an argument as the caller knows it, for example `points` or `weights[1]`.
pub type Argument = Cow<'static, str>;

/// Why a kernel refused its input. Nothing has been computed when it is returned.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// A number is outside its domain. `index` is empty for a scalar.
    Value {
        /// The argument at fault.
        argument: Argument,
        /// Where in the argument the number stands.
        index: Vec<usize>,
        /// What would have been accepted.
        expected: Cow<'static, str>,
        /// The number as it was given.
        found: String,
    },
    /// An array has the wrong shape, or a list the wrong length.
    Shape {
        /// The argument at fault.
        argument: Argument,
        /// What would have been accepted.
        expected: Cow<'static, str>,
        /// The shape or length as it was given.
        found: String,
    },
    /// An object of a wrong type or dtype.
    Type {
        /// The argument at fault.
        argument: Argument,
        /// What would have been accepted.
        expected: Cow<'static, str>,
        /// The type or dtype as it was given.
        found: String,
    },
    /// A name that is not among the known ones.
    Unknown {
        /// The argument at fault.
        argument: Argument,
        /// Every name that would have been accepted.
        known: &'static [&'static str],
        /// The name as it was given.
        found: String,
    },
    /// Arguments that are right one by one and wrong together.
    Conflict {
        /// The argument at fault.
        argument: Argument,
        /// What is wrong, as the rest of a sentence that begins with the argument.
        reason: Cow<'static, str>,
    },
    /// An array that another call is using at this moment.
    Busy {
        /// The argument at fault.
        argument: Argument,
    },
}

impl Error {
    /// A scalar outside its domain.
    pub fn scalar(
        argument: impl Into<Argument>,
        expected: impl Into<Cow<'static, str>>,
        found: impl fmt::Debug,
    ) -> Self {
        Self::element(argument, &[], expected, found)
    }

    /// An array element outside its domain.
    pub fn element(
        argument: impl Into<Argument>,
        index: &[usize],
        expected: impl Into<Cow<'static, str>>,
        found: impl fmt::Debug,
    ) -> Self {
        Self::Value {
            argument: argument.into(),
            index: index.to_vec(),
            expected: expected.into(),
            found: format!("{found:?}"),
        }
    }

    /// An array of the wrong shape.
    pub fn shape(
        argument: impl Into<Argument>,
        expected: impl Into<Cow<'static, str>>,
        found: impl Into<String>,
    ) -> Self {
        Self::Shape { argument: argument.into(), expected: expected.into(), found: found.into() }
    }

    /// Arguments that do not go together.
    pub fn conflict(argument: impl Into<Argument>, reason: impl Into<Cow<'static, str>>) -> Self {
        Self::Conflict { argument: argument.into(), reason: reason.into() }
    }

    /// The same error with another name for its argument, for callers that know it by another name.
    #[must_use]
    pub fn renamed(mut self, rename: impl FnOnce(&str) -> String) -> Self {
        let name = self.argument_mut();
        *name = rename(name).into();
        self
    }

    fn argument_mut(&mut self) -> &mut Argument {
        match self {
            Self::Value { argument, .. }
            | Self::Shape { argument, .. }
            | Self::Type { argument, .. }
            | Self::Unknown { argument, .. }
            | Self::Conflict { argument, .. }
            | Self::Busy { argument } => argument,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Value { argument, index, expected, found } => {
                write!(f, "{argument} must be {expected}, got {found}")?;
                if index.is_empty() {
                    return Ok(());
                }
                write!(f, " at {argument}[")?;
                for (k, i) in index.iter().enumerate() {
                    write!(f, "{}{i}", if k == 0 { "" } else { ", " })?;
                }
                write!(f, "]")
            }
            Self::Shape { argument, expected, found } | Self::Type { argument, expected, found } => {
                write!(f, "{argument} must be {expected}, got {found}")
            }
            Self::Unknown { argument, known, found } => {
                write!(f, "{argument} must be one of ")?;
                for (k, name) in known.iter().enumerate() {
                    write!(f, "{}'{name}'", if k == 0 { "" } else { ", " })?;
                }
                write!(f, ", got '{found}'")
            }
            Self::Conflict { argument, reason } => write!(f, "{argument} {reason}"),
            Self::Busy { argument } => {
                write!(f, "{argument} is being used by another call at this moment")
            }
        }
    }
}

impl std::error::Error for Error {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_names_the_argument_what_was_expected_the_value_and_the_place() {
        let error = Error::element("points", &[3, 1], "finite", f64::NAN);
        assert_eq!(error.to_string(), "points must be finite, got NaN at points[3, 1]");
    }

    #[test]
    fn an_unknown_name_lists_the_known_ones() {
        let error = Error::Unknown {
            argument: "kernel".into(),
            known: &["triangular", "gaussian"],
            found: "box".into(),
        };
        assert_eq!(error.to_string(), "kernel must be one of 'triangular', 'gaussian', got 'box'");
    }

    #[test]
    fn a_batch_can_rename_the_argument() {
        let error = Error::scalar("mean", "finite", 1.0).renamed(|name| format!("{name}s[1]"));
        assert_eq!(error.to_string(), "means[1] must be finite, got 1.0");
    }
}
