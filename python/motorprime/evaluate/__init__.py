"""The figures: one file per ``motorprime evaluate NAME``. Each returns plain numbers for JSON and a table."""
