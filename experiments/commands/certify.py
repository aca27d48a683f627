"""``hvf certify``: certificates of a field, a run, a map or a clip."""

import sys
from collections.abc import Sequence
from dataclasses import field, fields, replace
from pathlib import Path
from typing import Annotated

from pydantic import TypeAdapter
from tyro.conf import Positional

from controllers.certificates.flight.tolerance import BallisticTolerance, JudgementCriteria
from controllers.certificates.loop.hand import NO_HANDS, HandRange
from controllers.certificates.report import Certificate, ChangedInputs
from controllers.errors import ParameterError
from experiments.config.options import Options, RunOptions, config_of_options, given_options
from experiments.config.part import above, at_least, from_json, part
from experiments.config.run_config import RunConfig
from experiments.console.output import Json, say
from experiments.console.progress import working
from geometry.whole_files import write_text
from models.mocap.motion.clip import Clip
from sim.errors import SimError

COMMAND_FILE = "asked.json"
"""File beside a certificate, with the options of the command that made it."""


def _refuse_options(names: Sequence[str], beside: str, owner: str) -> None:
    if names:
        option = "--" + names[0].replace("_", "-")
        raise ParameterError(f"{option} has no meaning with {beside}; it belongs to {owner}")


@part
class Command:
    """Certify a field, a run, a map or the flights of a clip: certified, refuted or unknown."""

    options: Options = field(default_factory=RunOptions)  # pyright: ignore[reportInvalidTypeForm] - made of the parts
    """The field."""
    run: Positional[Path | None] = None
    """Folder of a run whose field and clips are certified as recorded."""
    clip: str | None = None
    """Judge this motion instead of a field: a file, or the name of an embedded clip."""
    out: Path | None = None
    """Folder for the certificate, runs/certificate by default, runs/certificate-CLIP of a clip; a certificate that is
    there already is taken if nothing has changed."""
    overwrite: bool = False
    """Replace a certificate of something else that the folder holds."""
    delay: Annotated[float, at_least(0.0, unit="s")] = 0.0
    """Delay of the motors' torques, for a field [s]."""
    hand_push: Annotated[float, at_least(0.0, unit="N")] = 1.0
    """Largest force of the hand for which the distance from the curve is bounded [N]."""
    hand: HandRange = field(default_factory=HandRange)
    """Impedance intervals of the hands that may hold the stylus."""
    no_hand: bool = False
    """Certify a stylus without a hand."""
    tolerance: BallisticTolerance = field(default_factory=BallisticTolerance)
    """What counts as a flight."""
    friction: Annotated[float, above(0.0)] = JudgementCriteria.friction
    """Coefficient of friction of soles on the floor, for clips [1]."""
    verify: Path | None = None
    """Only check that this certificate.json is of the same field, hands, clips and code, by default of those that it
    was made for; exit code 1 if it is not."""
    json: Json = False

    def __call__(self) -> int:
        """Certify, or verify."""
        self._refuse_unused()
        if self.verify is None:
            certificate = self._reuse_or_make()
        else:
            try:
                certificate = self._original_command(self.verify)._verify_against_inputs(self.verify)
            except ChangedInputs as error:
                print(f"hvf: {error}", file=sys.stderr)
                return 1
        lines = [f"{name}: {verdict.verdict}; {verdict.reason}" for name, verdict in certificate.verdicts.items()]
        if self.verify is not None:
            lines.insert(0, f"{self.verify}: valid, nothing that it covers has changed")
        say(certificate.to_json(), self.json, lines)
        return 0

    def _refuse_unused(self) -> None:
        """Refuse options that have no effect on a clip, a run, a stylus without a hand, or a field without clips."""
        from experiments.setups.certified_law import depends_on_clips

        words = [*given_options(self.options)]
        own = [name for name in ("delay", "hand_push", "no_hand") if getattr(self, name) != getattr(Command, name)]
        hand = [f"hand.{f.name}" for f in fields(self.hand) if getattr(self.hand, f.name) != f.default]
        if self.clip is not None:
            if self.run is not None:
                raise ParameterError(f"{self.run} has no meaning with --clip {self.clip}; certify one, then the other")
            _refuse_options([*words, *own, *hand], f"--clip {self.clip}", "a field")
        if self.run is not None:
            _refuse_options(words, f"a run, whose field is as recorded in {self.run}", "a field without a run")
        if self.no_hand:
            _refuse_options(hand, "--no-hand", "a hand on the stylus")
        if self.clip is None and self.run is None and not depends_on_clips(config_of_options(self.options)):
            criteria = fields(self.tolerance)
            judged = [f"tolerance.{f.name}" for f in criteria if getattr(self.tolerance, f.name) != f.default]
            _refuse_options(
                [*judged, *["friction"] * (self.friction != JudgementCriteria.friction)], "a field alone", "clips"
            )

    def _hand_range(self) -> HandRange:
        return NO_HANDS if self.no_hand else self.hand

    def _criteria(self) -> JudgementCriteria:
        return JudgementCriteria(self.tolerance, self.friction)

    def _config_and_clips(self) -> tuple[RunConfig, tuple[Clip, ...]]:
        """Configuration of the field, and the clips that are certified with it; none where only gains matter."""
        from experiments.setups.certified_law import depends_on_clips

        config = config_of_options(self.options)
        if self.run is None and not depends_on_clips(config):
            return config, ()
        from experiments.certify.certified_clips import run_and_clips

        return run_and_clips(self.run, config)

    def _reuse_or_make(self) -> Certificate:
        from experiments.certify.certify import CERTIFICATE, certify_clip_into, certify_into

        default = "runs/certificate" if self.clip is None else f"runs/certificate-{Path(self.clip).stem}"
        folder = self.out or Path(default)
        if (folder / CERTIFICATE).exists() and not self.overwrite:
            try:
                return self._verify_against_inputs(folder / CERTIFICATE)
            except ChangedInputs:
                raise SimError(
                    f"{folder}: holds a certificate of something else; choose another --out, or --overwrite it"
                ) from None
        with working("certifying" if self.clip is None else "certifying a clip"):
            if self.clip is not None:
                certificate = certify_clip_into(self.clip, folder, self._criteria())
            else:
                config, clips = self._config_and_clips()
                certificate = certify_into(
                    config, folder, self.delay, self._hand_range(), self.hand_push, clips, self._criteria()
                )
        options = replace(self, out=None, overwrite=False, json=False)
        text = TypeAdapter(Command).dump_json(options, indent=2, exclude_defaults=True).decode()
        write_text(folder / COMMAND_FILE, text)
        return certificate

    def _original_command(self, file: Path) -> "Command":
        """The command that made a certificate, unless this command has options of its own."""
        options_file = file.parent / COMMAND_FILE
        if replace(self, verify=None, json=False) != Command() or not options_file.exists():
            return self
        try:
            return from_json(Command, options_file.read_bytes(), str(options_file))
        except OSError as error:
            raise ParameterError(f"{options_file}: cannot be read ({error.strerror})") from None

    def _verify_against_inputs(self, file: Path) -> Certificate:
        from experiments.certify.certified_field import certificate_inputs
        from experiments.files.certificate_files import clip_inputs, verify_certificate

        if self.clip is not None:
            from experiments.setups.parts.clips import load_clips

            inputs = clip_inputs(load_clips([self.clip], raw=True)[0][0], self._criteria())
        else:
            config, clips = self._config_and_clips()
            inputs = certificate_inputs(config, self.delay, self._hand_range(), self.hand_push, clips, self._criteria())
        return verify_certificate(file, inputs)
