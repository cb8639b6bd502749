"""Bodies in three dimensions: one page of HTML, and the component that draws it."""
