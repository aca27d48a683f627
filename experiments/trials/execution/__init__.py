"""Execution of trials: on threads, in processes or on a cluster, into the database of the study."""
