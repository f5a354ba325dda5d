"""The exceptions that motorprime raises.

Every one derives from :class:`Error` and from the built-in exception that a Python user expects, so
``except ValueError`` works as well as ``except motorprime.Error``. Messages name the argument, what was
expected and what was given.
"""


class Error(Exception):
    """Base of every exception that motorprime raises on purpose."""


class ArgumentError(Error, ValueError):
    """An argument has the right type and a wrong value or shape."""


class ArgumentTypeError(Error, TypeError):
    """An argument has the wrong type or dtype."""


class StateError(Error, RuntimeError):
    """The call is right but cannot be carried out in the present state."""


class NotInViewError(StateError):
    """Nothing of what was asked for is in front of the camera or inside its image."""


class UnreachableError(StateError):
    """Joint limits keep arm or gaze from getting there; the call that raises it has moved nothing."""


class MissingExtraError(Error, ImportError):
    """An optional dependency is not installed; the message names the extra to install."""

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(f"{what} needs the optional extra '{extra}': pip install 'motorprime[{extra}]'")
        self.extra = extra
