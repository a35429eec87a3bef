"""The version of all that agents are written against."""

#: What an agent class may name as `api`; raised when agents that ran would no longer, or would do something else.
API_VERSION = 1
