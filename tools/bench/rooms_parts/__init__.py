"""Parts of `lemtomap bench rooms`."""
