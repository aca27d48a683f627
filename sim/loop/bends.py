"""Undo and redo of a curve that is bent in a field's memory, from Python, between two blocks."""

from controllers.curves.deformation import redo, undo
from controllers.state import Array
from sim.compilation.compiled import entry_point


@entry_point
def undo_bend(memory: Array, record: int) -> bool:
    """Take the last edit of the curve back whose record begins at ``memory[record]``; False if there is none."""
    return undo(memory, record)


@entry_point
def redo_bend(memory: Array, record: int) -> bool:
    """Make an edit again that was taken back; False if there is none."""
    return redo(memory, record)
