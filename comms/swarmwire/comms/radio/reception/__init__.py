"""Reception: error rates and sensitivity of receivers."""
