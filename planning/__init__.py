"""Planning: maps, convex cells, mutual visibility, deployments and paths, as functions of arrays."""
