//! Invocation policies, instance generators and fail policies for fleets.
#![forbid(unsafe_code)]
