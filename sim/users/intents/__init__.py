"""What people mean to do at the stylus: each intent becomes a table of wishes (see `sim.users.wishes`)."""
