"""What ``hvf`` prints when it is called without arguments."""

WELCOME = """hvf: a hand on a force-feedback arm feels an animation as a river, follows it, bends it.

  hvf demo                            see it work: a run, and a page to open in a browser
  hvf live                            take the stylus with the mouse, in the browser
  hvf run --clips A.bvh B.amc         the same over your own motion capture
  hvf run --mode stretch-then-follow  bend a curve, and perform it
  hvf render runs/demo                film a run
  hvf certify runs/demo               what is certain of its field: stability, passivity, energy
  hvf clips                           the clips that are there

hvf --help lists all commands, hvf COMMAND --help the options of one."""


def next_step(folder: str) -> str:
    """What can be done with the recording of an interrupted run, in words."""
    return (
        f"what was recorded until then is in {folder}: hvf report {folder} writes its page, summary and animations, "
        f"hvf render {folder} films it, "
        f"hvf run --config {folder}/config.json --out NEW runs it again"
    )
