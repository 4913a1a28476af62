//! Tools held on behalf of guests, such as the browsers behind one viewer.
//!
//! The server releases a tool when the liveliness token of its owner goes. A program may serve many guests
//! over one link. It therefore gives the tool of each guest a separate owner and token.

use scindo_proto::messages::ToolSample;
use scindo_proto::{Chunk, Topic, WireMessage as _, encode, encoding};
use zenoh::Wait as _;
use zenoh::bytes::Encoding;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority, Reliability};

use crate::error::LinkError;
use crate::link::Link;
use crate::tool::unix_ns;

/// A tool of a guest; owner and tool have the same id. Dropping it releases the tool.
pub struct GuestTool {
    publisher: Publisher<'static>,
    id: String,
    seq: u64,
    _token: LivelinessToken,
    _link: Link,
}

impl Link {
    /// Creates tool `id` for a guest. Its samples must state a shape.
    pub async fn guest_tool(&self, id: &str) -> Result<GuestTool, LinkError> {
        let chunk = Chunk::new("tool id", id)?;
        let token = self
            .haptic()
            .liveliness()
            .declare_token(self.keys().key(&Topic::Live(chunk.clone(), self.role())))
            .await
            .map_err(LinkError::zenoh("declare liveliness token"))?;
        let publisher = self
            .haptic()
            .declare_publisher(self.keys().key(&Topic::ToolPose(chunk.clone(), chunk)))
            .encoding(Encoding::from(encoding::<ToolSample>()))
            .priority(Priority::RealTime)
            .express(true)
            .congestion_control(CongestionControl::Drop)
            .reliability(Reliability::BestEffort)
            .await
            .map_err(LinkError::zenoh("declare pose publisher"))?;
        Ok(GuestTool { publisher, id: id.to_owned(), seq: 0, _token: token, _link: self.clone() })
    }
}

impl GuestTool {
    /// Sends `sample` after filling in ids, sequence number and client time.
    pub fn send(&mut self, mut sample: ToolSample) -> Result<(), LinkError> {
        self.seq += 1;
        sample.seq = self.seq;
        sample.client_time_ns = unix_ns();
        sample.client_id.clone_from(&self.id);
        sample.tool_id.clone_from(&self.id);
        sample.check()?;
        self.publisher.put(encode(&sample)).wait().map_err(LinkError::zenoh("send pose"))
    }
}
