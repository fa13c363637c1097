"""An example of each message, for its documents and for tests."""

from __future__ import annotations

from typing import Final

from protocol.messages import (
    Aim,
    AnyBody,
    Auction,
    Authority,
    Bid,
    Confirmation,
    ConvexPiece,
    Deployment,
    Goal,
    GoalReply,
    HeardRanges,
    Heartbeat,
    Intent,
    LastHeard,
    LinkView,
    MemberWay,
    Milestone,
    Motion,
    NewLink,
    Offer,
    Placement,
    Progress,
    RangeBase,
    RangeDigest,
    RangeReply,
    RangeRequest,
    Ranges,
    Reign,
    Ring,
    SharedRange,
    State,
    Topology,
    Tree,
    TreeProposal,
    Vote,
    VoteRequest,
    Warrant,
)

EXAMPLES: Final[tuple[AnyBody, ...]] = (
    Heartbeat(role="robot", mode="moving"),
    State(
        position=(4.0, 2.5),
        velocity=(0.6, 0.0),
        mode="moving",
        target=(7.0, 3.0),
        path=((4.0, 2.5), (6.5, 2.5), (7.0, 3.0)),
        obeying=Authority(epoch=1, leader="base", sequence=42),
        progress=Progress(epoch=1, plan=3, revision=1, finished=5),
    ),
    Intent(
        position=(9.0, 3.5),
        velocity=(0.0, 0.8),
        mode="moving",
        goal=(9.0, 8.0),
        path=((9.0, 3.5), (9.0, 8.0)),
    ),
    Goal(goal=(12.5, 4.0), correlation="5f2c9a"),
    GoalReply(correlation="5f2c9a", accepted=True),
    Deployment(
        authority=Authority(epoch=1, leader="base", sequence=42),
        warrant=Warrant(
            lease_s=0.71, marks=(LastHeard(peer="base", mark="0.9"), LastHeard(peer="robot1", mark="0.7", age_s=0.19))
        ),
        decision=7,
        placements=(
            Placement(robot="robot1", position=(7.0, 3.0), cell=118),
            Placement(robot="robot2", position=(9.0, 2.5), spare=True),
        ),
        edges=(("base", "robot1"), ("robot1", "agent")),
        cost=1.8,
        total_cost_m=11.4,
        lower_bound_m=11.4,
        relays_needed=1,
        reason="the agent was about to leave the sight of the base",
        motion=Motion(
            plan=3,
            revision=1,
            first_stage=5,
            released=5,
            ways=(
                MemberWay(member="base", radius_m=0.25, speed_m_s=0.0, waypoints=((1.0, 1.0),), stages=(0, 0, 0)),
                MemberWay(
                    member="robot1",
                    radius_m=0.25,
                    speed_m_s=0.6,
                    waypoints=((4.0, 2.5), (6.5, 2.5), (7.0, 3.0)),
                    stages=(0, 2, 2),
                ),
                MemberWay(
                    member="robot2", radius_m=0.25, speed_m_s=0.6, waypoints=((9.0, 4.0), (9.0, 2.5)), stages=(0, 0, 1)
                ),
            ),
            connection="joined",
            joined=("base", "robot1"),
        ),
    ),
    VoteRequest(
        epoch=3,
        correlation="0.57",
        warrant=Warrant(
            lease_s=0.65,
            marks=(LastHeard(peer="base", mark="0.56", age_s=0.247), LastHeard(peer="robot1", mark="1.203")),
        ),
    ),
    Vote(
        candidate="robot2",
        correlation="0.57",
        granted=True,
        promise=Reign(epoch=3, leader="robot2", incarnation=0),
        mark="1.204",
    ),
    Topology(
        authority=Authority(epoch=3, leader="robot2", sequence=17),
        warrant=Warrant(lease_s=0.84, marks=(LastHeard(peer="base", mark="0.56"),)),
        committed=Tree(
            number=(3, 1),
            members=("base", "robot1", "agent"),
            edges=(("base", "robot1"), ("robot1", "agent")),
            reason="1 relay needed for the agent at (9, 3.5) m",
        ),
        proposal=TreeProposal(
            tree=Tree(
                number=(3, 2),
                members=("base", "robot1", "robot2", "agent"),
                edges=(("base", "robot1"), ("robot1", "robot2"), ("robot2", "agent")),
                reason="2 relays for the agent 4 m on from (9, 3.5) m",
            ),
            links=(
                NewLink(ends=("robot1", "robot2"), since=Milestone(epoch=3, plan=1, revision=4, stage=12)),
                NewLink(ends=("robot2", "agent"), since=Milestone(epoch=3, plan=1, revision=4, stage=14)),
            ),
            released=(("robot1", "agent"),),
            method="optimum",
            round=1,
        ),
    ),
    Confirmation(
        proposal=(3, 2),
        views=(LinkView(peer="robot2", verdict="will"),),
        committed=Tree(
            number=(3, 1),
            members=("base", "robot1", "agent"),
            edges=(("base", "robot1"), ("robot1", "agent")),
            reason="1 relay needed for the agent at (9, 3.5) m",
        ),
    ),
    Auction(
        authority=Authority(epoch=3, leader="robot2", sequence=18),
        warrant=Warrant(lease_s=0.84, marks=(LastHeard(peer="base", mark="0.56"),)),
        auction=5,
        center=(9.0, 3.5),
        aims=(Aim(places=((9.0, 3.5), (9.0, 7.5)), shares=(0.0, 1.0), ahead_m=4.0),),
        robots=(
            Placement(robot="robot1", position=(7.0, 3.0)),
            Placement(robot="robot2", position=(9.0, 2.5)),
        ),
        standing=("robot1",),
    ),
    Bid(
        epoch=3,
        auction=5,
        offers=(
            Offer(
                aim=0,
                whole=True,
                total_cost_m=14.2,
                cost=2.1,
                relays=(
                    Placement(robot="robot1", position=(7.0, 3.0), cell=118),
                    Placement(robot="robot2", position=(9.0, 5.0), cell=121),
                ),
                removed=("robot1", "agent"),
                added=("robot1", "robot2"),
            ),
        ),
    ),
    RangeRequest(position=(4.0, 2.5), correlation="17.204"),
    RangeReply(asker="robot1", correlation="17.204", range_m=5.13, bound_m=0.2),
    Ranges(
        ranges=(
            SharedRange(
                owner="robot1", start=0, number=204, time_s=51.25, anchor=(4.0, 2.5), range_m=5.13, bound_m=0.204
            ),
        )
    ),
    RangeDigest(
        clock_s=51.5,
        heard=(
            HeardRanges(owner="base", start=0, below=207),
            HeardRanges(owner="robot1", start=0, below=203, beyond=(204,)),
        ),
    ),
    RangeBase(
        time_s=48.75,
        owner="robot1",
        start=0,
        number=194,
        heard=(HeardRanges(owner="base", start=0, below=196), HeardRanges(owner="robot1", start=0, below=195)),
        fingerprint=3141592653,
        origin=(1.5, 1.0),
        pieces=(ConvexPiece(corners=((7.1, 2.2), (7.4, 2.1), (7.5, 2.9)), checked_m=0.31),),
        rings=(Ring(center=(2.5, 1.5), inner_m=4.93, outer_m=5.33),),
        rejections=0,
        anchor=(4.0, 2.5),
        slack_m=0.24,
    ),
)
