"""The figure: a humanoid skeleton of 57 degrees of freedom with de Leva's segment inertias."""
