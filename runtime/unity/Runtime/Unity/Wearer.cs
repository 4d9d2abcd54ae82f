// The humanoid that wears a kimono: its bones become poses, and poses its bones.

using System;
using UnityEngine;

namespace Kitsuke.Unity
{
    /// <summary>How the bones of a wearer stand in the T-pose.</summary>
    public enum TPose
    {
        /// <summary>As they stand when the component starts, before the Animator first moves them: any humanoid that is saved in its
        /// T-pose, VRM 1.0 among them.</summary>
        AtStart,
        /// <summary>All along the model's axes: VRM 0.x, VRM 1.0 whose bones are normalised, UniVRM's control rig.</summary>
        Normalised,
    }

    internal sealed class Wearer
    {
        private readonly Rig rig;
        private readonly Transform root, hipsBone;
        private readonly Transform[] bones = new Transform[Bones.Count];
        private readonly Rotation[] now = new Rotation[Bones.Count];

        internal Wearer(Pack pack, Animator animator, TPose tPose)
        {
            if (!animator.isHuman) throw new ArgumentException($"{animator.name} has no humanoid avatar", nameof(animator));
            root = animator.transform;
            rig = new Rig(pack, Axes.Unity);
            foreach (var bone in rig.Bones) bones[(int)bone] = animator.GetBoneTransform(Humanoid(bone));
            hipsBone = animator.GetBoneTransform(HumanBodyBones.Hips);
            Record(tPose);
        }

        /// Takes the T-pose of the bones as they stand now, or as normalised ones do.
        internal void Record(TPose tPose)
        {
            foreach (var bone in rig.Bones)
            {
                var transform = bones[(int)bone];
                if (transform == null) rig.SetRest(bone, null);
                else rig.SetRest(bone, tPose == TPose.Normalised ? Rotation.Identity : OfModel(transform));
            }
        }

        internal Pose Pose()
        {
            for (var i = 0; i < bones.Length; i++)
                if (bones[i] != null) now[i] = OfModel(bones[i]);
            var hips = root.InverseTransformPoint(hipsBone.position);
            return rig.Pose(now, new Place(hips.x, hips.y, hips.z));
        }

        internal void Show(Pose pose)
        {
            var hips = rig.Stand(pose, now);
            hipsBone.position = root.TransformPoint(new Vector3(hips.X, hips.Y, hips.Z));
            // Parents first: a child's rotation is set after those above it have moved it.
            for (var i = 0; i < rig.Bones.Count; i++)
            {
                var at = (int)rig.Bones[i];
                if (bones[at] != null) bones[at].rotation = root.rotation * new Quaternion(now[at].X, now[at].Y, now[at].Z, now[at].W);
            }
        }

        private Rotation OfModel(Transform bone)
        {
            var q = Quaternion.Inverse(root.rotation) * bone.rotation;
            return new Rotation(q.x, q.y, q.z, q.w);
        }

        /// Unity calls the bones as VRM does, but for those of the thumb.
        private static HumanBodyBones Humanoid(Bone bone)
        {
            var name = bone.ToString().Replace("ThumbProximal", "ThumbIntermediate").Replace("ThumbMetacarpal", "ThumbProximal");
            return (HumanBodyBones)Enum.Parse(typeof(HumanBodyBones), name);
        }
    }
}
