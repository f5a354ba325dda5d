"""The child that measures: ``python -m motorprime.bench OPTIONS``; options, progress and result are JSON."""

from __future__ import annotations

import json
import sys

from ..errors import Error
from .measure import measure


def _say(kind: str, content: object) -> None:
    sys.stdout.write(json.dumps({kind: content}) + "\n")
    sys.stdout.flush()


def main() -> None:
    """Measure what the one argument asks for; a line of JSON for everything that happens."""
    options = json.loads(sys.argv[1])
    try:
        result = measure(
            options["names"],
            options["seed"],
            options["quick"],
            lambda done, of, what: _say("progress", [done, of, what]),
        )
    except Error as error:
        _say("error", str(error))
    else:
        _say("result", result)


if __name__ == "__main__":
    main()
