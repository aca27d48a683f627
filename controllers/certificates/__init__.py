"""Certificates: proofs about the laws that run, by CasADi; the only place that imports it."""
