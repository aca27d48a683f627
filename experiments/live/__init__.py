"""The page on which a person takes the stylus: a servo of its own, what it shows, and what is done with it."""
