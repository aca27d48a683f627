"""The inputs of a field's certificate: every law of the executed program is among them."""

from controllers.certificates.loop.hand import NO_HANDS
from controllers.certificates.report import hash_of
from experiments.certify.certified_field import certificate_inputs
from experiments.config.options import run_config


def inputs_hash(**words):
    return hash_of(certificate_inputs(run_config(**words), 0.0, NO_HANDS, 1.0))


def test_inputs_hash_differs_for_every_executed_law():
    clips = ("backflip",)
    hashes = {
        inputs_hash(clips=clips),
        inputs_hash(clips=clips, governor=True),
        inputs_hash(clips=clips, governor=True, governor_drag=200.0),
        inputs_hash(clips=clips, walls=True),
        inputs_hash(clips=clips, walls=True, wall_stiffness=0.2),
        inputs_hash(clips=clips, orientation_stiffness=0.05),
        inputs_hash(clips=clips, mode="bunny"),
        inputs_hash(clips=clips, mode="bunny", bunny_pace="clock"),
        inputs_hash(clips=clips, mode="bunny", bunny_attraction="convolution"),
        inputs_hash(clips=clips, mode="stretch"),
        inputs_hash(clips=clips, mode="stretch", rubber_from="stylus"),
    }
    assert len(hashes) == 11
