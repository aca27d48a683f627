"""The paper's own forms, as options: a bunny that is convolved, a tube that is held from where the stylus was."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.errors import ParameterError
from controllers.fields.bunny import Bunny
from controllers.fields.stretchy_tubes import StretchyTubes
from controllers.state import HandState
from experiments.config.words import run_config
from experiments.setups.certified_law import certified_laws

CIRCLE = Trajectory.circle(0.0477, 4.0)


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.012, -0.007, 0.004), (-0.03, 0.02, 0.01)])
def test_the_convolved_bunny_is_the_integral_by_quadrature(offset):
    k, b, delta = 300.0, 8.0, 0.02
    bunny, pace = CIRCLE.point(0.7), CIRCLE.velocity(0.7)
    p, v = bunny + np.array(offset), np.array([0.02, -0.01, 0.03])
    # Gauss and Hermite: ∫ f(q) G_δ(p − q) d³q / (2πδ²)^{3/2}, with f felt within δ of the bunny.
    nodes, weights = np.polynomial.hermite.hermgauss(40)
    x = np.sqrt(2.0) * delta * nodes
    q = p + np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1)
    mass = np.einsum("i,j,k->ijk", weights, weights, weights) / np.pi**1.5
    felt = np.exp(-0.5 * np.sum((q - bunny) ** 2, axis=-1) / delta**2)
    field = felt[..., None] * (k * (bunny - q) + b * (pace - v))
    integral = np.einsum("ijk,ijkc->c", mass, field)
    law = Bunny(CIRCLE, k, b, delta, "convolution", "clock")
    np.testing.assert_allclose(law.wrench(HandState.at(p, v, 0.7)).force, integral, atol=1e-9)


def test_the_bunny_by_default_is_weighted_and_an_unknown_form_is_refused():
    p, v = CIRCLE.point(0.7) + 0.01, np.zeros(3)
    weighted, convolved = (
        Bunny(CIRCLE, 300.0, 8.0, 0.02, form, "clock").wrench(HandState.at(p, v, 0.7)).force
        for form in ("point", "convolution")
    )
    assert np.linalg.norm(weighted) > 2.0 * np.linalg.norm(convolved)
    with pytest.raises(ParameterError, match="convolution"):
        Bunny(CIRCLE, 300.0, 8.0, 0.02, "smeared")  # pyright: ignore[reportArgumentType]


def test_a_convolved_bunny_is_certified_by_the_gains_that_are_felt():
    law = certified_laws(run_config(mode="bunny", bunny_attraction="convolution"))[""]
    assert law.stiffness == pytest.approx(300.0 / 2.0**2.5)
    assert law.damping == pytest.approx(8.0 / 2.0**1.5)
    assert law.width == pytest.approx(0.05 * np.sqrt(2.0))


@pytest.mark.parametrize("hold", ["curve", "stylus"])
def test_a_held_tube_pulls_to_the_place_that_is_chosen(hold):
    program = StretchyTubes(CIRCLE, 150.0, 200.0, 14.0, hold=hold).program()
    memory, wrench, away = program.fresh_memory(), np.empty(6), CIRCLE.point(1.0) * 1.1
    from controllers.fields.algebra.program import evaluate

    def force(p, switch, t):
        hand = HandState.at(p, (0.0, 0.0, 0.0), t)._replace(switch=switch).vector()
        evaluate(*program.compiled(), memory, hand, wrench)
        return wrench[:3].copy()

    force(away, False, 0.0)
    at_grab = force(away, True, 1e-3)
    pulled = force(away + 0.01, True, 2e-3)
    place = CIRCLE.point(1.0) if hold == "curve" else away
    # The whole step of the default is k_s times the distance at which it is taken hold of.
    np.testing.assert_allclose(at_grab, 200.0 * (place - away), atol=1e-3)
    np.testing.assert_allclose(pulled, 200.0 * (place - away - 0.01), atol=1e-3)
    if hold == "stylus":
        assert np.linalg.norm(at_grab) == 0.0


@pytest.mark.parametrize("row", ["rubber-from", "bunny-attraction", "k_s", "damping b is added", "convolution"])
def test_the_table_of_the_paper_names_what_differs(row):
    from pathlib import Path

    assert row in (Path(__file__).parents[2] / "docs" / "explanation" / "paper.md").read_text(encoding="utf-8")
