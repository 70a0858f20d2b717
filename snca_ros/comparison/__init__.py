"""Types of controllers compared: tests, tables, figures, one page."""
