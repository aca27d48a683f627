"""The page of a prepared capture: measures before and after, what was changed, pictures and a replay of both."""

from html import escape

from experiments.files.html_page import html_page, image
from experiments.preparation.filmstrip import filmstrip
from experiments.preparation.prepared_file import Measured, PreparedFile, changes, gaps
from experiments.preparation.side_by_side_replay import both_html


def page(outcome: PreparedFile, captured: Measured) -> str:
    """The report as a self-contained page: measures before and after, what was changed, pictures and replay of both."""
    prepared, (before, follows) = outcome.prepared, captured
    picture = image(filmstrip({"as captured": prepared.captured, "prepared": prepared.clip}), "stick figures")
    gap_before, gap = gaps(prepared)
    names = ("soles", "ends", "continuity", "dynamics", "loop", "physical figure")
    captured_lines = (*before.lines(), gap_before, follows.line())
    prepared_lines = (*outcome.measures.lines(), gap, outcome.followed.line())
    rows = "".join(
        f"<tr><th>{name}</th><td>{escape(first)}</td><td>{escape(then)}</td></tr>"
        for name, first, then in zip(names, captured_lines, prepared_lines, strict=True)
    )

    def listed(title: str, lines: tuple[str, ...]) -> str:
        points = "".join(f"<li>{escape(line)}</li>" for line in lines)
        return f"<h2>{title}</h2><ul>{points}</ul>" if lines else ""

    verdict = "Not well-formed." if outcome.faults() else "Well-formed."
    body = (
        f'<p>{verdict} {escape(outcome.followed.line().capitalize())}.</p><div class="wide"><table>'
        f"<tr><th></th><th>captured</th><th>prepared</th></tr>{rows}</table></div>"
        + listed("What was changed", changes(prepared))
        + listed(
            "What is not within bounds, not certified, or not in the clip",
            (*outcome.faults(), *outcome.doubts, *outcome.advice()),
        )
        + f'<iframe title="both in 3D" srcdoc="{escape(both_html(prepared.captured, prepared.clip))}"></iframe>'
        + picture
        + listed("How the file was read", prepared.report.lines() if prepared.report else ())
    )
    style = "th, td { text-align: left; vertical-align: top; }"
    return html_page(f"{prepared.clip.name}, prepared", body, style)
