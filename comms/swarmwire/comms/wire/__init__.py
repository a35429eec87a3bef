"""The wire between world and runners: zenoh sessions and keys, frames and their contents."""
