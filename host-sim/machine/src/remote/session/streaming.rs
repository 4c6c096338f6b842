//! The words of a streamed job, sent while it runs.

use protocol::message::{Reason, Reply};

use super::requests::name;
use super::{Feed, RemoteError, Session};

/// Frames of a part of a job after which the next parts are shorter.
const TRIES_MANY: u32 = 3;

impl Session {
    /// The job whose words are sent while it runs, or none.
    pub(in crate::remote) fn set_feed(&mut self, feed: Option<Feed>) {
        self.feed = feed;
    }

    /// The streamed job, if the last one was.
    pub(in crate::remote) fn streamed(&self) -> Option<&crate::prepare::Prepared> {
        self.feed.as_ref().map(|feed| &feed.job)
    }

    pub(super) fn has_room(&mut self, room: u32) {
        if let Some(feed) = &mut self.feed {
            feed.has_room(room);
        }
    }

    /// Whether words of a streamed job are left.
    pub(in crate::remote) fn has_words(&self) -> bool {
        self.feed.as_ref().is_some_and(|feed| !feed.is_over())
    }

    /// Sends the next words of a streamed job, if there is room for any; false where there is none.
    ///
    /// # Errors
    /// As [`Self::command`].
    pub(in crate::remote) fn feed_board(&mut self) -> Result<bool, RemoteError> {
        let most = self.capabilities.description.chunk_words_max;
        let Some((chunk, sent)) = self.feed.as_ref().and_then(|feed| feed.next(most)) else {
            return Ok(false);
        };
        let reply = self.ask(&chunk)?;
        let is_bad = self.tries > TRIES_MANY;
        let Some(feed) = &mut self.feed else {
            return Ok(false);
        };
        feed.adapt(is_bad);
        match reply {
            Reply::Nak {
                reason: Reason::TooLong { limit, .. },
                ..
            } => feed.has_no_room(limit),
            Reply::Nak {
                reason: Reason::WrongOffset { expected },
                ..
            } => feed.has(expected),
            Reply::Nak { reason, .. } => {
                self.feed = None;
                return Err(RemoteError::Refused {
                    request: name(&chunk),
                    reason,
                });
            }
            _ => feed.has(sent),
        }
        Ok(true)
    }
}
