// The sample komon: shows StreamingAssets/komon.kitsuke with arms that go down and up, or on the humanoid that is given.

using System.IO;
using UnityEngine;
using Kitsuke;
using Kitsuke.Unity;

public sealed class KomonSample : MonoBehaviour
{
    [SerializeField] private Animator wearer;
    [SerializeField] private Material material;

    private KitsukeBehaviour kimono;

    private void Start()
    {
        var shown = new GameObject("kimono");
        kimono = shown.AddComponent<KitsukeBehaviour>();
        shown.GetComponent<MeshRenderer>().sharedMaterial = material;
        kimono.Animator = wearer;
        kimono.Open(File.ReadAllBytes(Path.Combine(Application.streamingAssetsPath, "komon.kitsuke")));
        Debug.Log($"{kimono.Pack.Name}: {kimono.Pack.Information.VertexCount} vertices");
    }

    private void Update()
    {
        if (wearer != null) return;
        // In Unity's axes the left arm points along -X, and the front is +Z: about +Z it goes down.
        var halfRad = 0.4f * (1 + Mathf.Sin(Time.time)) / 2;
        kimono.Pose = new Kitsuke.Pose()
            .With(Bone.LeftUpperArm, new Rotation(0, 0, Mathf.Sin(halfRad), Mathf.Cos(halfRad)))
            .With(Bone.RightUpperArm, new Rotation(0, 0, -Mathf.Sin(halfRad), Mathf.Cos(halfRad)));
    }
}
