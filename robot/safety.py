"""The last gate before the wheels."""
