"""The figure: 57 degrees of freedom, de Leva's segments."""
