"""From requirements to designs: free parameters, objectives, search, tolerance."""
