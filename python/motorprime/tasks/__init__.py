"""The paper's two tasks: exploring for an object, and reaching for it."""
