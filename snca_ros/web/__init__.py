"""Web pages that play a recorded walk or show a running one."""
