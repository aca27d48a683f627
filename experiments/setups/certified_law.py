"""A law of force as a certificate takes it."""

from typing import NamedTuple


class CertifiedLaw(NamedTuple):
    """A law of force that a run uses: its name among `controllers.certificates.loop.laws.LAWS`, and its gains.

    Attributes
    ----------
    law : str
        Name.
    stiffness, damping : float
        [N/m], [N s/m].
    width : float
        ε or δ [m]; infinite if the law has none.
    """

    law: str
    stiffness: float
    damping: float
    width: float
