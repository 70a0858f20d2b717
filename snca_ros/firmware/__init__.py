"""Firmware for microcontrollers: the C of a cell, and the host's end of its link."""
