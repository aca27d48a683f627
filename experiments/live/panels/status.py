"""Status lines at the top of the live page: clock, pace, driver, progress, faults; and the first steps."""

import html

from controllers.safety.faults import Fault
from experiments.live.session.desk import Desk
from geometry.arrays import Array

FIRST_STEPS = """
- **Drag the orange ball**: it is your hand on the stylus. The stylus lags behind it as a hand feels the field: the
  green arrow is the force on you, the orange one yours. Let go, and the stylus finds its way back to the curve.
- The **figure** moves as the stylus does; the translucent one shows the undisturbed animation.
- To **change the animation for good**, choose the mode *stretch-then-follow* and *Run this*, tick *Grab and bend*, drag
  the curve, and *Perform the bent curve*.
- **Keys**: I J K L and U O move the hand (H lets go), space pauses and goes on, N steps, Z and Y undo and redo,
  R resets.
- *Gains* shows whether the loop is stable; *Takes* records what you do, and downloads it; *Clips* takes your motion.
- Turn the view by dragging beside the ball, zoom with the wheel, move it with the right button.
"""


def status_html(now: dict[str, Array], driver: int | None, going: str, desk: Desk) -> str:
    """HTML of the status lines, including a fault of the device."""
    median, high = 1e3 * now["cost"]
    pace = "paused; space or “Pause” resumes" if desk.paused else f"{now['pace'][0]:.2f} × real time"
    lines = [f"<b>{now['t'][0]:.2f} s</b> · {pace}"]
    if desk.paused and desk.holds:
        lines.append("<b>Press space</b>: you hold the stylus, but time is paused")
    if going:
        lines.append(html.escape(going))
    elif driver is None:
        lines.append("<b>Drag the orange ball</b> (keys: I J K L U O)")
    else:
        lines.append(f"browser {driver} drives")
    if desk.records:
        lines.append(f'<b style="color:#c02020">● recording, {now["recording"][0]:.1f} s</b>')
    if now["fault"][0] != 0.0:
        lines.append(f"the motors are off: {Fault(int(now['fault'][0])).words(now['fault'][1])}; press “Re-arm”")
    lines.append(f'<span style="color:#7a8494">a tick takes {median:.2f} ms, 99 % under {high:.2f} ms</span>')
    return "".join(f'<p style="margin:.25rem .75rem;font-size:.8rem">{line}</p>' for line in lines)
