// Problems in the steps of a body, in words. Each kind is listed separately, and only while it occurs.

import type { BodyStats } from "../gen/scindo/v1/server_pb";
import { count, exponent } from "./units";

export interface Trouble {
  kind: "error" | "refused" | "divided" | "rolled-back" | "inverted" | "unbalanced" | "missed";
  /** Text for the header of the page, after the body's name. Empty for problems that only the panel shows. */
  short: string;
  /** Text for the panel. */
  words: string;
}

export function troubles(body: BodyStats): Trouble[] {
  const found: Trouble[] = [];
  const say = (kind: Trouble["kind"], short: string, words: string) => found.push({ kind, short, words });
  if (body.refusedSteps > 0n) {
    say("refused", "refuses steps", `${many(body.refusedSteps, "step")} refused; the body stood still in them`);
  }
  if (body.inverted > 0) say("inverted", "is inverted", `${many(body.inverted, "element")} inverted: the result is wrong there`);
  if (body.unbalancedSteps > 0n) {
    say("unbalanced", "shakes", `energy came from nowhere ${many(body.unbalancedSteps, "time")}: the body may shake; a shorter step helps`);
  }
  if (body.unconverged && !body.fixedIterations) {
    say("error", "does not converge", `the solver stopped above its tolerance: residual ${exponent(body.residual)}, tolerance ${exponent(body.tolerance)}`);
  }
  if (body.unconvergedSteps > 0n && !body.fixedIterations && !body.unconverged) {
    say("missed", "", `${many(body.unconvergedSteps, "step")} ended above the tolerance so far`);
  }
  if (body.rolledBackSteps > 0n) say("rolled-back", "was rolled back", `${many(body.rolledBackSteps, "step")} rolled back`);
  if (body.dividedSteps > 0n) say("divided", "", `${many(body.dividedSteps, "step")} divided into shorter ones`);
  return found;
}

function many(n: bigint | number, what: string): string {
  return `${count(Number(n))} ${what}${Number(n) === 1 ? "" : "s"}`;
}
