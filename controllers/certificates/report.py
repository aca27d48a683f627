"""Format of certificates: verdicts with margin, reason and counterexample, and the hash of all their inputs."""

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Literal, TypeAlias, cast, get_args

import numpy as np

from controllers.errors import ControllerError

Outcome: TypeAlias = Literal["certified", "refuted", "unknown"]
FROM_WORST: tuple[Outcome, ...] = ("refuted", "unknown", "certified")
"""Outcomes in order of severity."""
Json: TypeAlias = bool | int | float | str | list["Json"] | dict[str, "Json"] | None


class CertificateError(ControllerError):
    """A certificate that cannot be read."""


class ChangedInputs(CertificateError):
    """A certificate whose inputs differ from the present ones."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """Verification result of one property.

    Parameters
    ----------
    verdict : {"certified", "refuted", "unknown"}
        Proved under the assumptions; disproved by the counterexample; or neither.
    reason : str
        Explanation in one sentence with numbers.
    margin : float, optional
        Distance to the loss of the property, in the unit that `reason` names; negative if refuted. None if there is no
        such number.
    assumptions : tuple of str
        Conditions under which the verdict holds.
    counterexample : mapping
        Initial state and anything else that a simulation needs to show the failure; only for a refuted property.
    figures : mapping
        Additional numbers and arrays: boundaries, spectra, bounds per phase.

    Raises
    ------
    CertificateError
        If the verdict is not one of the three, if it is refuted without a counterexample, or if it has one otherwise.
    """

    verdict: Outcome
    reason: str
    margin: float | None = None
    assumptions: tuple[str, ...] = ()
    counterexample: Mapping[str, object] = field(default_factory=dict[str, object], repr=False)
    figures: Mapping[str, object] = field(default_factory=dict[str, object], repr=False)

    def __post_init__(self) -> None:
        if self.verdict not in get_args(Outcome):
            raise CertificateError(f"a verdict is one of {', '.join(get_args(Outcome))}, got {self.verdict!r}")
        if (self.verdict == "refuted") != bool(self.counterexample):
            raise CertificateError(f"a counterexample goes with what is refuted, and only with it; {self.reason}")

    def __str__(self) -> str:
        return f"{self.verdict}: {self.reason}"


def without_laws(verdict: Verdict, laws: Sequence[str]) -> Verdict:
    """Verdict on a whole program, from the verdict on the program without some `laws`: certified becomes unknown.

    Refuted stays refuted, under the assumption that the omitted laws give no force there.
    """
    named = " and ".join(laws)
    if verdict.verdict == "refuted":
        return replace(verdict, assumptions=(*verdict.assumptions, f"where this happens there is no force of {named}"))
    return replace(verdict, verdict="unknown", reason=f"left out: {named}; without: {verdict.reason}")


@dataclass(frozen=True, eq=False)
class Certificate:
    """Verdicts by name, and the hash of all inputs.

    Parameters
    ----------
    verdicts : mapping of str to Verdict
        Such as ``stability``, ``passivity``, ``ballistic``.
    inputs : str
        `hash_of` all inputs of the verdicts: gains, curve, device, period, hand, clip, and the code.
    parts : mapping of str to str
        `hashes_of` the inputs one by one, so that a changed input can be named.
    """

    verdicts: Mapping[str, Verdict]
    inputs: str
    parts: Mapping[str, str] = field(default_factory=dict[str, str])

    def to_json(self) -> dict[str, Json]:
        """The certificate for JSON: ``inputs``, ``parts`` and one entry per verdict; non-finite numbers become null."""
        hashes: dict[str, Json] = {"inputs": self.inputs, "parts": {**self.parts}}
        return hashes | {name: _to_json(verdict) for name, verdict in self.verdicts.items()}

    @staticmethod
    def from_json(values: object) -> "Certificate":
        """Inverse of `to_json`.

        Raises
        ------
        CertificateError
            If the values are not a certificate.
        """
        try:
            entries = dict(cast(Mapping[str, dict[str, object]], values))
            inputs, parts = entries.pop("inputs"), entries.pop("parts", {})
            verdicts: dict[str, Verdict] = {}
            for name, entry in entries.items():
                assumptions = tuple(cast(Sequence[str], entry["assumptions"]))
                verdicts[name] = Verdict(**entry | {"assumptions": assumptions})  # pyright: ignore[reportArgumentType]
        except (TypeError, KeyError, ValueError) as error:
            raise CertificateError(
                f"not a certificate ({error}); expected 'inputs' and one object a verdict with "
                f"{', '.join(item.name for item in fields(Verdict))}"
            ) from None
        if not isinstance(inputs, str):
            raise CertificateError(f"not a certificate: 'inputs' is {inputs!r}; expected a hash")
        return Certificate(verdicts, inputs, cast(Mapping[str, str], parts))

    def check(self, inputs: object) -> None:
        """Check that this certificate belongs to these inputs.

        Raises
        ------
        ChangedInputs
            If any input has changed.
        """
        found = hash_of(inputs)
        if found == self.inputs:
            return
        now = hashes_of(cast(Mapping[str, object], inputs)) if self.parts and isinstance(inputs, Mapping) else {}
        changed = [name for name in (*self.parts, *now) if self.parts.get(name) != now.get(name)]
        changes = f"; changed: {', '.join(dict.fromkeys(changed))}" if now else ""
        raise ChangedInputs(f"the certificate is of inputs {self.inputs}, these are {found}{changes}; certify again")


def hash_of(inputs: object) -> str:
    """Hash of the exact values of inputs, 16 hex digits.

    Parameters
    ----------
    inputs
        Numbers, strings, bytes, arrays, None, and sequences, mappings and dataclasses of them.

    Raises
    ------
    CertificateError
        If there is a value of another type.
    """
    return hashlib.sha256(_encode(inputs)).hexdigest()[:16]


def hashes_of(inputs: Mapping[str, object]) -> dict[str, str]:
    """`hash_of` each input, by name."""
    return {name: hash_of(value) for name, value in inputs.items()}


def _encode(value: object) -> bytes:
    """Unambiguous bytes of a value: every part is preceded by its kind and length."""
    if isinstance(value, np.ndarray):
        array = np.ascontiguousarray(value)
        if array.dtype.hasobject:
            raise CertificateError("an array of objects cannot be hashed")
        parts, kind = [str(array.dtype).encode(), str(array.shape).encode(), array.tobytes()], "array"
    elif isinstance(value, np.generic):
        return _encode(value.item())
    elif value is None or isinstance(value, bool | int | float | str):
        parts, kind = [repr(value).encode()], type(value).__name__
    elif isinstance(value, bytes):
        parts, kind = [value], "bytes"
    elif is_dataclass(value) and not isinstance(value, type):
        named = {item.name: getattr(value, item.name) for item in fields(value) if item.init}
        parts, kind = [type(value).__name__.encode(), _encode(named)], "dataclass"
    elif isinstance(value, Mapping):
        entries = cast(Mapping[object, object], value)
        parts = [part for pair in sorted((_encode(k), _encode(v)) for k, v in entries.items()) for part in pair]
        kind = "mapping"
    elif isinstance(value, Sequence):
        parts, kind = [_encode(item) for item in cast(Sequence[object], value)], "sequence"
    else:
        raise CertificateError(f"an input of type {type(value).__name__} cannot be hashed: {value!r}")
    return b"".join([f"{kind}{len(parts)}:".encode(), *(f"{len(part)}:".encode() + part for part in parts)])


def _to_json(value: object) -> Json:
    if isinstance(value, np.ndarray | np.generic):
        return _to_json(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, Mapping):
        return {str(key): _to_json(item) for key, item in cast(Mapping[object, object], value).items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {item.name: _to_json(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, Sequence):
        return [_to_json(item) for item in cast(Sequence[object], value)]
    raise CertificateError(f"a verdict holds {value!r}, which JSON does not take")
