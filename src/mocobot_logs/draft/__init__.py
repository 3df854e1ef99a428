"""Drafts of maps, from what a log's columns and topics are called and hold."""
