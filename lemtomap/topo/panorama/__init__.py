"""What stands round a point, bearing by bearing, and how alike two such views are."""
