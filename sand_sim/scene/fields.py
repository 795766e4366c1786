"""Reading values from a parsed YAML file so that every refusal names the field and how to mend it."""

import difflib
import math
from collections.abc import Callable, Iterable
from os.path import expanduser  # unlike that of Path it leaves a home that nobody knows as it is
from pathlib import Path
from typing import Any

from sand_sim.scene.types import SceneError

_LARGEST = 1e30  # nobody means more, or less than its inverse, and powers of it are still numbers


class Field:
    """A value in the file and the path that leads to it."""

    def __init__(self, value: Any, path: str = ""):
        self.value, self.path = value, path

    def refuse(self, problem: str) -> SceneError:
        """The error to raise for this field."""
        return SceneError(f"{self.path or 'scene'}: {problem}")

    def keys(self, allowed: Iterable[str], required: Iterable[str] = ()) -> "Field":
        """See that the value is a mapping with no unknown and all required keys."""
        if not isinstance(self.value, dict):
            raise self.refuse(f"must be a mapping of fields, got {_shown(self.value)}")
        allowed = list(allowed)
        for key in self.value:
            if key not in allowed:
                near = difflib.get_close_matches(str(key), allowed, 1)
                hint = f"did you mean '{near[0]}'?" if near else f"known fields are {', '.join(allowed)}"
                raise self.refuse(f"unknown field '{key}'; {hint}")
        for key in required:
            if key not in self.value:
                raise self.refuse(f"the field '{key}' is missing")
        return self

    def __contains__(self, key: str) -> bool:
        return self.value.get(key) is not None

    def __getitem__(self, key: str) -> "Field":
        return Field(self.value.get(key), f"{self.path}.{key}" if self.path else key)

    def items(self) -> list[tuple[str, "Field"]]:
        """Entries of a mapping by name, in the order of the names: a mapping has no other."""
        if not isinstance(self.value, dict):
            raise self.refuse(f"must be a mapping of names, got {_shown(self.value)}")
        return [(str(key), self[key]) for key in sorted(self.value, key=str)]

    def entries(self) -> list["Field"]:
        """Entries of a list."""
        if not isinstance(self.value, list):
            raise self.refuse(f"must be a list, got {_shown(self.value)}")
        return [Field(value, f"{self.path}[{index}]") for index, value in enumerate(self.value)]

    def number(self, above: float = -math.inf, least: float = -math.inf, most: float = math.inf, unit: str = "") -> float:
        """A finite number, greater than ``above``, at least ``least`` and at most ``most``."""
        try:
            if isinstance(self.value, bool):
                raise TypeError
            number = float(self.value)  # also turns '1e7', which YAML reads as text, into a number
        except (TypeError, ValueError, OverflowError):  # of whole numbers with hundreds of digits
            raise self.refuse(f"must be a number{_in(unit)}, got {_shown(self.value)}") from None
        if not math.isfinite(number):
            raise self.refuse(f"must be finite, got {number}")
        if number and not 1.0 / _LARGEST <= abs(number) <= _LARGEST:
            raise self.refuse(f"must be between {1.0 / _LARGEST:g} and {_LARGEST:g} in size, or 0, got {number:g}")
        if not (number > above and least <= number <= most):
            bounds = [f"greater than {above:g}"] if above > -math.inf else []
            bounds += [f"at least {least:g}"] if least > -math.inf else []
            bounds += [f"at most {most:g}"] if most < math.inf else []
            raise self.refuse(f"must be {' and '.join(bounds)}{_in(unit)}, got {number:g}")
        return number

    def whole(self, least: int, most: float = math.inf) -> int:
        """A whole number of at least ``least`` and at most ``most``."""
        number = self.number(least=least, most=most)
        if number != int(number):
            raise self.refuse(f"must be a whole number, got {number:g}")
        return int(number)

    def text(self) -> str:
        """A non-empty text."""
        if not isinstance(self.value, str) or not self.value:
            raise self.refuse(f"must be a text, got {_shown(self.value)}")
        return self.value

    def file(self, folder: Path) -> Path:
        """The path of a file; relative ones start at a folder."""
        return folder / expanduser(self.text())

    def yes_or_no(self) -> bool:
        """True or false."""
        if not isinstance(self.value, bool):
            raise self.refuse(f"must be true or false, got {_shown(self.value)}")
        return self.value

    def choice(self, known: Iterable[str]) -> str:
        """One of the known names."""
        known = list(known)
        name = self.text()
        if name not in known:
            raise self.refuse(f"unknown '{name}'; known are {', '.join(known)}")
        return name

    def vector(self, length: int = 3) -> tuple[float, ...]:
        """A list of finite numbers."""
        if not isinstance(self.value, list) or len(self.value) != length:
            raise self.refuse(f"must be a list of {length} numbers, got {_shown(self.value)}")
        return tuple(entry.number() for entry in self.entries())

    def direction(self) -> tuple[float, ...]:
        """A vector that is not zero."""
        vector = self.vector()
        if not any(vector):
            raise self.refuse("must not be the zero vector")
        return vector

    def optional(self, key: str, read: Callable[["Field"], Any], default: Any) -> Any:
        """Read an entry if it is there and not null, else take the default."""
        return read(self[key]) if key in self else default


def _shown(value: Any) -> str:
    shown = "nothing" if value is None else repr(value)
    return shown if len(shown) <= 60 else shown[:57] + "..."


def _in(unit: str) -> str:
    return f" [{unit}]" if unit else ""
