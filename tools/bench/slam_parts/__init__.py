"""What `lemtomap bench slam` measures of the metric layer, a part each."""
