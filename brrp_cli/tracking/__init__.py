"""Objects followed from frame to frame: whose ids stay, what has not moved, what is at rest."""
