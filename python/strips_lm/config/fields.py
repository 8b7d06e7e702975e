"""Between TOML and dataclass fields: values checked against their annotations, both ways. Knows no section.

Annotations understood: `bool`, `int`, `float`, `str`, `Literal[…]`, `tuple[X, ...]`, `dict[str, X]` and `X | None`.
"""

from __future__ import annotations

import json
import tomllib
import types
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from strips_lm.config.names import ConfigError, suggestion

if TYPE_CHECKING:
    from collections.abc import Mapping

    from _typeshed import DataclassInstance

    Section = TypeVar("Section", bound=DataclassInstance)


def build(section: type[Section], values: Mapping[str, Any], where: str) -> Section:
    """Makes the dataclass `section` of a TOML table that stands under `where`.

    Raises:
        ConfigError: a key is unknown, or a value has the wrong type or contradicts another.
    """
    hints = field_types(section)
    for key in values:
        if key not in hints:
            raise ConfigError(f"no field `{where}.{key}`{suggestion(key, hints)}")
    checked = {key: coerce(hints[key], value, f"{where}.{key}") for key, value in values.items()}
    return section(**checked)


def field_types(section: type[DataclassInstance]) -> dict[str, Any]:
    """Each field's annotation, resolved."""
    hints = get_type_hints(section)
    return {field.name: hints[field.name] for field in fields(section)}


def parse_value(text: str) -> Any:
    """Reads the right side of `--set key=value`: a TOML value, or else the text itself."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def coerce(wanted: Any, value: Any, where: str) -> Any:
    """Returns `value` as the annotation `wanted` has it, whole numbers being floats where asked.

    Raises:
        ConfigError: it is of another type, or not among the choices.
    """
    origin, arguments = get_origin(wanted), get_args(wanted)
    if origin is Literal:
        return _choice(arguments, value, where)
    if origin in (types.UnionType, Union):
        return None if value in (None, "none") else coerce(arguments[0], value, where)
    if origin is tuple and isinstance(value, list | tuple):
        return tuple(coerce(arguments[0], item, where) for item in value)
    if origin is dict and isinstance(value, dict):
        return {key: coerce(arguments[1], item, f"{where}.{key}") for key, item in value.items()}
    if wanted is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if origin is None and type(value) is wanted:
        return value
    raise ConfigError(f"`{where}` takes {describe(wanted)}, not {value!r}")


def _choice(choices: tuple[Any, ...], value: Any, where: str) -> Any:
    if any(value == choice and type(value) is type(choice) for choice in choices):
        return value
    raise ConfigError(f"`{where}` takes {_either(choices)}, not {value!r}{suggestion(str(value), map(str, choices))}")


def _either(choices: tuple[Any, ...]) -> str:
    """The choices as TOML has them."""
    return " or ".join(_value(choice) if isinstance(choice, bool) else str(choice) for choice in choices)


def describe(wanted: Any) -> str:
    """The annotation in words."""
    origin, arguments = get_origin(wanted), get_args(wanted)
    names = {bool: "true or false", int: "a whole number", float: "a number", str: "a string"}
    if origin is Literal:
        return _either(arguments)
    if origin in (types.UnionType, Union):
        return f"{describe(arguments[0])} or none"
    if origin is tuple:
        return f"a list, each {describe(arguments[0])}"
    if origin is dict:
        return f"a table, each value {describe(arguments[1])}"
    return names.get(wanted, str(wanted))


def to_toml(table: Mapping[str, Any]) -> str:
    """Writes a table of scalars, lists and tables as TOML; what is None is left out."""
    plain = {key: value for key, value in table.items() if not isinstance(value, dict) and value is not None}
    lines = [f"{_key(key)} = {_value(value)}" for key, value in plain.items()]
    for key, value in table.items():
        if isinstance(value, dict):
            lines += ["", f"[{key}]", *(f"{_key(k)} = {_value(v)}" for k, v in value.items() if v is not None)]
    return "\n".join(lines).lstrip("\n") + "\n"


def _key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else json.dumps(key)


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }" if value else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False)
