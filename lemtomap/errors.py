"""What can go wrong in LEMTOMap, split by what the caller must do.

LemtomapError
├── BadInput      a file or a setting is unusable: tell the user its name, the place and the reason
│   ├── BadLog       a recorded log
│   ├── BadMap       a map file: foreign, truncated, of a newer schema
│   ├── BadSample    an argument that is none: its numbers are of another kind or shape
│   └── BadSetting   a configuration that cannot work
├── NotStarted    something was asked for that is there from the first scan on
└── NoRoute       the goal cannot be reached: report, take the next goal
"""


class LemtomapError(Exception):
    """Root of the tree."""


class BadInput(LemtomapError):
    """Something the user gave cannot be used; the text is one line that says what and where."""


class BadLog(BadInput):
    """A recorded log cannot be read; the text names file, line and reason."""


class BadMap(BadInput):
    """A map file cannot be used; the text names the file and the reason."""


class BadSample(BadInput):
    """A scan, a pose or another argument cannot be used; the text names it, and its shape or value."""


class BadSetting(BadInput):
    """A setting cannot work; the text names it and its limits.

    names: the fields it is about, where they are known; any of them may be the one to change.
    """

    def __init__(self, text: str, *names: str) -> None:
        super().__init__(text)
        self.names = names


class NotStarted(LemtomapError):
    """A snapshot was asked for before the first scan."""


class NoRoute(LemtomapError):
    """There is no way to the goal; the text says why."""
