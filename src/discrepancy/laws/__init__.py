"""Laws that no catalogue lists: where something is wrong, of what it is a function, and by which formula."""
