"""Effects that no catalogue lists, each with its law: what is wrong where, as which function of what."""
