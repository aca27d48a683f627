"""Undo and redo of edits to a stretchy curve in a field's memory, called from Python between two blocks."""

from controllers.curves.deformation import redo, undo
from controllers.state import Array
from sim.compilation.compiled import entry_point


@entry_point
def undo_bend(memory: Array, record: int) -> bool:
    """Undo the last edit of the curve whose edit record begins at ``memory[record]``; False if there is none."""
    return undo(memory, record)


@entry_point
def redo_bend(memory: Array, record: int) -> bool:
    """Redo the edit that was undone last; False if there is none."""
    return redo(memory, record)
