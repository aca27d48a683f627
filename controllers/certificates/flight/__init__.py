"""Certificates of a motion's flight phases, turns and contacts, and the repair of infeasible motions."""
