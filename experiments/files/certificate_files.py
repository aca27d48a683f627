"""Reading certificates from files, and checking them against their inputs, without CasADi."""

import json
from collections.abc import Mapping
from pathlib import Path

from controllers.certificates.flight.tolerance import JudgementCriteria
from controllers.certificates.report import Certificate, CertificateError, ChangedInputs
from experiments.files.json_text import json_text
from models.mocap.motion.clip import Clip
from sim.compilation.sources import sources_hash


def clip_inputs(clip: Clip, criteria: JudgementCriteria) -> dict[str, object]:
    """All inputs of the verdicts on a clip, by name, for `hash_of`."""
    return {"clip": (clip.fps, clip.poses), "judging": criteria, "code": code_inputs()}


def code_inputs() -> str:
    """Hash of the code that verdicts depend on, of the libraries and the processor."""
    return sources_hash("experiments.certify.certify")


def read_certificate(file: Path) -> Certificate:
    """The certificate in a file.

    Raises
    ------
    CertificateError
        If the file holds no certificate.
    """
    try:
        return Certificate.from_json(json.loads(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise CertificateError(f"{file}: cannot be opened ({error.strerror}); expected a certificate.json") from None
    except (ValueError, RecursionError) as error:
        raise CertificateError(f"{file}: {error}") from None


OPTIONS = "certified.json"
"""File beside a certificate with the options that it was made with."""


def changed_options(file: Path, options: Mapping[str, object]) -> str:
    """Options that differ from those of a file's certificate, in words; empty if these are not known."""
    try:
        certified = json.loads((file.parent / OPTIONS).read_text(encoding="utf-8"))
        here = json.loads(json_text(options))
        differ = [name for name in (*certified, *here) if certified.get(name) != here.get(name)]
    except (OSError, ValueError, AttributeError):
        return ""
    return ", ".join(f"{name} {certified.get(name)} (here {here.get(name)})" for name in dict.fromkeys(differ))


def verify_certificate(file: Path, inputs: Mapping[str, object]) -> Certificate:
    """The certificate in a file, after checking that it is of these inputs: `certificate_inputs` or `clip_inputs`.

    Raises
    ------
    CertificateError
        If the file holds no certificate.
    ChangedInputs
        If any input differs; the message says which.
    """
    certificate = read_certificate(file)
    try:
        certificate.check(inputs)
    except ChangedInputs as error:
        raise ChangedInputs(f"{file}: {error}") from None
    return certificate
