"""What the studio shows beside the scene: numbers along the arm, volumes, histograms, sections."""
