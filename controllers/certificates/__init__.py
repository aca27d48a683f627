"""Certificates: verification of the executed laws and motions, by CasADi; the only package that imports it."""
