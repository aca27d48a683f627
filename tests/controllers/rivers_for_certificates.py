"""The circle, device and river that certificates are tested with."""

from controllers.certificates.loop.laws import FOLLOW_LAW
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.loop.stability import CertifiedRiver
from controllers.curves.trajectory import Trajectory
from experiments.certify.certified_device import phantom_device

CIRCLE = Trajectory.circle(0.0477, 4.0)
DEVICE = phantom_device()
SAMPLING = Sampling(1e-3)


def river(law=FOLLOW_LAW, k_r=300.0, b_d=8.0, width=0.25, curve=CIRCLE, sampling=SAMPLING):
    return CertifiedRiver(law, k_r, b_d, width, curve, DEVICE, sampling)
