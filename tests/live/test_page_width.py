"""Static pages fit a phone: nothing is wider than its screen but what scrolls by itself."""

from pathlib import Path
from typing import Any

import pytest

from experiments.files.html_page import html_page

pytestmark = pytest.mark.processes

CELL = "<td>a cell that does not break</td>"
BODY = f"""<p>runs/{"a-very-long-folder-" * 12}</p><div class="found"><p>{"found " * 40}</p></div>
<div class="wide"><table style="white-space: nowrap"><tr>{12 * CELL}</tr></table></div>
<svg width="10" height="10"></svg><img alt="" width="1200" height="20" src="data:,"><pre>{"x" * 300}</pre>
<iframe title="replay" srcdoc="&lt;p&gt;replay"></iframe>"""


def test_page_fits_a_phone(chromium: Any, tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text(html_page("study_of_" + "everything_" * 8, BODY), encoding="utf-8")
    phone = chromium.new_page(viewport={"width": 390, "height": 780})
    phone.goto((tmp_path / "page.html").as_uri())
    assert phone.evaluate("document.documentElement.scrollWidth") <= 390
    assert phone.evaluate("document.querySelector('.wide').scrollWidth") > 390  # it scrolls by itself
    assert phone.evaluate("getComputedStyle(document.querySelector('p')).fontSize") == "16px"
    phone.close()
