"""The inputs of a field's certificate: every law of the executed program is among them."""

from controllers.certificates.loop.hand import NO_HANDS
from controllers.certificates.report import hash_of
from experiments.certify.certified_field import certificate_inputs
from experiments.config.words import run_config


def inputs(**words):
    return hash_of(certificate_inputs(run_config(**words), 0.0, NO_HANDS, 1.0))


def test_inputs_hash_differs_for_every_executed_law():
    clips = ("backflip",)
    told = {
        inputs(clips=clips),
        inputs(clips=clips, governor=True),
        inputs(clips=clips, governor=True, governor_drag=200.0),
        inputs(clips=clips, walls=True),
        inputs(clips=clips, walls=True, wall_stiffness=0.2),
        inputs(clips=clips, orientation_stiffness=0.05),
        inputs(clips=clips, mode="bunny"),
        inputs(clips=clips, mode="bunny", bunny_pace="clock"),
        inputs(clips=clips, mode="bunny", bunny_attraction="convolution"),
        inputs(clips=clips, mode="stretch"),
        inputs(clips=clips, mode="stretch", rubber_from="stylus"),
    }
    assert len(told) == 11
