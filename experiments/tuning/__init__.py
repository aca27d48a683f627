"""Tuning: any numbers of a configuration, by what people at the stylus make of them, within what is certified."""
