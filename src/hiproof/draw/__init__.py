"""Pictures of models: a view for notebooks without network, a plot over points, every primitive with its parameters' names."""
